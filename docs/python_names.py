"""The names that `vsacli` exports, with signature and first sentence, for the page on Python."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import vsacli

GROUPS = {
    "Robots": "load_robot import_urdf Robot Joint DenavitHartenberg Link Inertia Pose Tool Limits "
    "Antagonistic Elastic Rigid Serial Motor Friction Damper laws mechanisms Placeholders",
    "Trajectories": "load_trajectory Trajectory Motion Wrench",
    "Inverse dynamics and its results": "inverse_dynamics motor_torques Result Report Flag open_result fixes "
    "compare Comparison sensitivity Sensitivity identify Identification plan_excitation Excitation "
    "excitation_text optimize Optimum size_drives Sizing run_study StudySummary",
    "Links": "link_torques forward_kinematics jacobian tip_compliance mass_matrix",
    "Control and simulation": "State state_derivative Gains feedback_linearization FeedbackLinearization "
    "Integral simulate perturbed simulate_perturbed InitialError Sensors GoalTolerance Tolerances",
    "Errors": "InputError StorageError",
}
"""What is exported, in the order in which one comes across it."""

METHODS = (
    "replace",
    "from_samples",
    "at",
    "stretched",
    "of",
    "save",
    "plot",
    "to_xarray",
    "constant",
    "from_poles",
)
"""Methods for users; other public ones are for other rooms."""


def public_names() -> str:
    """A section for each group; a line for each name, and for each method of a class."""
    sections = (
        f"### {title}\n\n" + "\n".join(map(_entry, names.split())) + "\n" for title, names in GROUPS.items()
    )
    return "\n".join(sections)


def _entry(name: str) -> str:
    thing = getattr(vsacli, name)
    if isinstance(thing, ModuleType):
        names = ", ".join(f"`{each}`" for each in thing.__all__)
        return f"- `{name}`: {_sentence(thing)} It has {names}."
    lines = [f"- `{name}{_signature(thing)}`: {_sentence(thing)}"]
    if inspect.isclass(thing):
        lines += [f"  - `.{method}`: {_sentence(each)}" for method, each in _methods(thing)]
    return "\n".join(lines)


def _methods(record: type) -> Iterator[tuple[str, Any]]:
    """Its own `METHODS`, each with its signature."""
    for name, member in vars(record).items():
        method = member.__func__ if isinstance(member, classmethod) else member
        if name in METHODS and inspect.isfunction(method):
            yield f"{name}{_signature(getattr(record, name), drop_self=method is member)}", method


def _signature(thing: Any, *, drop_self: bool = False) -> str:
    """Parameters with their defaults; the types stand in the docstring."""
    if inspect.isclass(thing) and issubclass(thing, int):
        return ""
    parameters = list(inspect.signature(thing).parameters.values())[int(drop_self) :]
    shown, marked = [], False
    for parameter in parameters:
        if parameter.kind is parameter.KEYWORD_ONLY and not marked:
            shown.append("*")
            marked = True
        shown.append(_parameter(parameter))
    return f"({', '.join(shown)})"


def _parameter(parameter: inspect.Parameter) -> str:
    stars = "**" if parameter.kind is parameter.VAR_KEYWORD else ""
    if parameter.default is parameter.empty:
        return f"{stars}{parameter.name}"
    default = "..." if callable(parameter.default) else repr(parameter.default)
    return f"{parameter.name}={default if len(default) < 30 else '...'}"


def _sentence(thing: Any) -> str:
    """The first sentence of its docstring."""
    summary = re.sub(r"\s+", " ", (inspect.getdoc(thing) or "").partition("\n\n")[0])
    return summary if summary.endswith(".") else f"{summary}."
