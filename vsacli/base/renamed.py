"""Public names that changed before version 0.1, each with its successor.

A name that is not known is looked up here (`did_you_mean`), so that its error says what it is called now.
`docs/renamed.md` lists them all.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple


class Renaming(NamedTuple):
    """A public name that changed: a table of the documentation has a row for each.

    Attributes:
        kind: kind of name, such as "option" or "variable".
        old: the name before.
        new: the name now.
        place: command, file or function that has it.
        usage: how an option is written now, if its value has changed as well.
    """

    kind: str
    old: str
    new: str
    place: str
    usage: str = ""


_STORED = "results and simulations, `--variables`, Python, generated C"
_SIMULATED = "simulations, `--variables`, recordings, Python"

RENAMINGS: tuple[Renaming, ...] = (
    Renaming("variable", "tau_spring", "tau_transmission", _STORED),
    Renaming("variable", "stiffness_lower", "stiffness_min", _STORED),
    Renaming("variable", "stiffness_upper", "stiffness_max", _STORED),
    Renaming("Python name", "stiffness_min", "commanded_min", "`JointReport`"),
    Renaming("Python name", "stiffness_max", "commanded_max", "`JointReport`"),
    *(
        Renaming("variable", name, f"{name}_ref", "simulations: the command")
        for name in ("q", "dq", "ddq", "stiffness", "dstiffness")
    ),
    Renaming("variable", "tau_motor", "tau_motor_cmd", "simulations: the command"),
    *(
        Renaming("variable", f"{name}_actual", name, _SIMULATED)
        for name in (
            *("q", "dq", "ddq", "stiffness", "dstiffness", "tau_e", "phi", "dphi", "theta", "dtheta"),
            *("tau_motor", "elastic_energy", "motor_power", "motor_energy", "det_A", "damping"),
            *("tau_damper", "dissipated_power", "current", "voltage", "copper_loss"),
        )
    ),
    Renaming("variable", "tau_spring_actual", "tau_transmission", _SIMULATED),
    Renaming("verdict", "doubtful", "unreliable", "`invdyn`, `check-feasibility`, `identify`, `size`"),
    Renaming("verdict", "strayed", "off_target", "`simulate`"),
    Renaming("verdict", "untold", "unidentifiable", "`identify`"),
    Renaming("verdict", "misfit", "poor_fit", "`identify`"),
    Renaming("key of reports", "doubtful", "unreliable", "columns of `fits`"),
    Renaming("option", "--suggest", "--fixes", "`check-feasibility`"),
    Renaming("option", "--remedy", "--write-fix", "`check-feasibility`"),
    Renaming(
        "option",
        "--write-fixed",
        "--write-fix",
        "`check-feasibility`; FILE is that of `-o` now",
        usage="--write-fix N -o FILE",
    ),
    Renaming("key of reports", "suggestions", "fixes", "`check-feasibility --fixes`"),
    Renaming("key of reports", "remedies", "fixes", "`check-feasibility --fixes`"),
    Renaming("Python name", "suggest", "fixes", "`vsacli`"),
    Renaming("Python name", "Suggestions", "Fixes", "`vsacli.studies.search`"),
    Renaming("Python name", "Remedy", "Fix", "`vsacli.studies.search`"),
    Renaming("key of robots", "preload", "branch", "`antagonistic`, `shifted_cams`"),
    Renaming("key of reports", "other_preload", "other_branch", "`joints`"),
    Renaming("key of reports", "preload", "branch", "entries of `fixes`"),
    Renaming("key of reports", "preloads", "branches", "`branch` of `fixes`"),
    Renaming("parameter", "preload", "branch", "`Antagonistic`, `mechanisms.ShiftedCams`"),
    Renaming("Python name", "opposite_preload", "opposite_branch", "`mechanisms.Mechanism`"),
    Renaming("Python name", "other_preload", "other_branch", "`mechanisms.Mechanism`"),
    Renaming("key of reports", "steps", "samples", "`joints`, their `uncertainty`, and `simulate`"),
    Renaming("key of reports", "reachable", "attainable", "`margin` of `joints`"),
    Renaming("key of reports", "torque_step", "torque_discontinuity", "`start` of `joints`"),
    Renaming("option", "--near-singular", "--min-margin", "check-feasibility"),
    Renaming("option", "--margin", "--min-margin", "optimize"),
    Renaming("key of studies", "margin", "min_margin", "optimize"),
    Renaming("parameter", "near_singular", "min_margin", "fixes"),
    Renaming("parameter", "margin", "min_margin", "optimize"),
    Renaming("key of reports", "near_singular", "min_margin", "fixes of check-feasibility"),
    Renaming("key of reports", "margin", "min_margin", "optimize"),
    Renaming("option", "--tolerance", "--goal-tolerance", "simulate"),
    Renaming("option", "--measure", "--feedback", "simulate"),
    Renaming("parameter", "measured", "feedback", "simulate"),
    Renaming("option", "--deflections", "--deflection-solver", "invdyn, check-feasibility"),
    Renaming("value", "integrate", "ode", "--deflection-solver, deflections.method of reports"),
    Renaming("parameter", "deflections", "deflection_solver", "inverse_dynamics"),
    Renaming("option", "--begins-at", "--time-offset", "compare"),
    Renaming("parameter", "begins_at", "time_offset", "compare"),
    Renaming("key of reports", "begins_at", "time_offset", "compare"),
    Renaming("value", "copper", "copper_loss", "minimize of optimize, size and studies"),
    Renaming("value", "utilisation", "utilization", "minimize of size"),
    Renaming("option", "--catalogue", "--catalog", "size"),
    Renaming("parameter", "catalogue", "catalog", "size_drives"),
    Renaming("key of reports", "catalogue", "catalog", "size"),
    Renaming("key of reports", "minimised", "minimized", "optimize"),
    Renaming("key of reports", "begins_at_error", "time_offset_error", "compare"),
)


def successor(word: str, valid: Iterable[str]) -> str | None:
    """Return the present name of a renamed word, or of a column with one, if it is valid, else None."""
    options = set(valid)
    return next((new for each in RENAMINGS if (new := _replaced(each, word)) in options), None)


def usage(option: str) -> str:
    """Return how an option that was renamed is written now, if that is more than its name; else empty."""
    return next((each.usage for each in RENAMINGS if each.old == option), "")


def now_called(word: str, valid: Iterable[str]) -> str:
    """Return a clause to append to an error, `; it is now 'x'`; empty if the word was not renamed."""
    new = successor(word, valid)
    return "" if new is None else f"; it is now {new!r}"


def refuse_old_names(cls: type, base: type) -> None:
    """Refuse a subclass that overrides an attribute by its name before, which would have no effect.

    Raises:
        TypeError: with the present name.
    """
    for each in RENAMINGS:
        if each.kind == "Python name" and each.old in vars(cls) and base.__name__ in each.place:
            raise TypeError(f"{cls.__name__}.{each.old} has no effect; it is now {each.new!r}")


def _replaced(renaming: Renaming, word: str) -> str | None:
    """Return a word with its new name, e.g. of the column `elbow.tau_motor_actual_1`; None without one."""
    if word == renaming.old:
        return renaming.new
    if renaming.kind != "variable" or renaming.old not in word:
        return None
    beginning, ending = r"(^|(?<=\.))", r"(?=\d*(_shaft)?(_[12])?$)"
    column, count = re.subn(beginning + re.escape(renaming.old) + ending, renaming.new, word)
    return column if count else None
