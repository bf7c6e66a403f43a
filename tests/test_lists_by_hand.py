"""Lists that are kept by hand: an entry that is missing in one of them fails here."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re

from samples.command_line import REPOSITORY

from vsacli import Limits, Motor, laws, load_robot
from vsacli.dynamics import limits
from vsacli.results.store.reader import MAGNITUDE_DATASETS, RANGE_DATASETS
from vsacli.studies.search import fixed_text
from vsacli.studies.sizing.sizing import SHARED_COLUMNS
from vsacli.trajectory.curves.closed_form import TYPES, ClosedForm
from vsacli.trajectory.curves.sequence import PARTS

OF_PLACE = {"inertia", "gear_ratio", "side", "damping", "friction"}
"""Fields of a motor in a robot file that `size` writes from the place and the gear, or in another form."""

NO_PARTS = {"sequence", "constant", "csv"}
"""Types of positions that a sequence does not contain: itself, what `dwell` does, and recordings."""


def test_figures_draw_every_limit() -> None:
    """All limits of joints with a damper, motors with windings, and springs."""
    bounds = {f"limits.{field.name}": 10 for field in dataclasses.fields(Limits)}
    of_motors = [field.name for field in dataclasses.fields(Motor) if field.name.startswith("max_")]
    bounds |= {f"actuator.motor.{name}": 10 for name in ("torque_constant", "resistance", *of_motors)}
    bounds |= {"actuator.motor.gear_ratio": 1, "actuator.motor.side": "joint"}
    bounds |= {"actuator.spring.max_deflection": 1, "damper": {"location": "link", "range": [0, 1]}}
    robot = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml")
    robot = robot.replace({f"joints.*.{path}": value for path, value in bounds.items()})
    checked = {check.variable for joint in robot.joints for check in limits.limit_checks(joint)}
    assert checked == RANGE_DATASETS.keys() | MAGNITUDE_DATASETS.keys()


def test_a_chosen_motor_keeps_every_field_of_motors() -> None:
    assert {field.name for field in dataclasses.fields(Motor)} == {*SHARED_COLUMNS, *OF_PLACE}


def test_a_sequence_contains_every_type_of_position() -> None:
    of_positions = {name for name, (_, uses) in TYPES.items() if "position" in uses}
    assert PARTS.keys() == of_positions - NO_PARTS | {"dwell"}


def test_fixed_files_have_a_formula_for_every_curve() -> None:
    for name in ("polynomial", "via_points", "sinusoids", "steps", "sequence"):
        importlib.import_module(f"vsacli.trajectory.curves.{name}")
    known = set(re.findall(r"case (\w+)\(", inspect.getsource(fixed_text.formula)))
    assert known == {each.__name__ for each in subclasses(ClosedForm) if not inspect.isabstract(each)}


def subclasses(cls: type) -> set[type]:
    """All classes of the package that derive from a class."""
    own = {each for each in cls.__subclasses__() if each.__module__.startswith("vsacli.")}
    return own.union(*map(subclasses, own))


def test_every_law_is_offered() -> None:
    assert {name.title().replace("_", "") for name in laws.LAWS} <= set(laws.__all__)
