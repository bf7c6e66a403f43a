"""What is not finite, in each entry of each input of the generated functions: nothing leaves unnoticed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import expected_of, motion_of, with_springs
from samples.generated_code import STRICT, Compiled, compile_c, compiled_robot, write_files
from samples.marks import COMPILERS, needs_compiler, slow, slow_but
from samples.plants import all_rigid
from samples.shipped import shipped_robot
from samples.springs import SPRINGS

from vsacli import Flag, InputError, Robot, motor_torques
from vsacli.compute.engine import choose_engine
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.self_test import ReferenceResults
from vsacli.dynamics.inverse import InverseDynamics

pytestmark = needs_compiler

BAD = (np.nan, np.inf, -np.inf, 1e300)
"""The last one is infinite in single precision, and its square is in double."""

FACTORS = (-1.5, 0.5, 1.1, 1000.0)
"""By which an entry is changed, to see what depends on it, also after rounding to single precision."""

STOPS = int(Flag.INFEASIBLE | Flag.SINGULAR)
"""What a loop written for version 0.1.0 brakes on."""

ROBOTS: dict[str, Robot] = {
    "3R": shipped_robot("vsa_3r"),
    "mixed": shipped_robot("mixed_3r"),
    "prismatic": shipped_robot("rp_2"),
    "rigid": all_rigid("RPR", 5),
    "tendon": shipped_robot("tendon_1r"),
    **{law: with_springs(law) for law in SPRINGS},
}


def functions(robot: Robot) -> Iterator[Function]:
    yield link_torques_function(robot)
    yield inverse_dynamics_function(robot)
    try:
        yield feedback_linearization_function(robot)
    except InputError:
        return


def changed(clean: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Inputs (values x entries, entries), each the clean ones but for one entry; from (values, entries)."""
    count = len(clean)
    rows = np.tile(clean, (len(values), count, 1))
    rows[:, np.arange(count), np.arange(count)] = values
    return rows.reshape(-1, count)


def arguments(function: Function, rows: np.ndarray) -> list[dict[str, np.ndarray]]:
    """The arguments that rows (calls, entries) of all entries stand for."""
    ends = np.cumsum([structure.layout.size for _, structure in function.arguments])
    parts = np.split(rows, ends[:-1], axis=1)
    return [
        {name: np.moveaxis(array, -1, 0) for name, array in structure.layout.arrays(part.T).items()}
        for (_, structure), part in zip(function.arguments, parts, strict=True)
    ]


def entries(function: Function, robot: Robot) -> np.ndarray:
    """All entries of a call that goes well."""
    given = ReferenceResults(robot).inputs(function)
    return np.concatenate(
        [
            arrays[array.name][0].ravel()
            for (_, structure), arrays in zip(function.arguments, given, strict=True)
            for array in structure.arrays
        ]
    )


def numbers(found: dict[str, np.ndarray]) -> np.ndarray:
    """All results but the bits, (calls, joints, columns)."""
    return np.concatenate(
        [
            values.reshape(*values.shape[:2], -1).astype(float)
            for name, values in found.items()
            if name != "flags"
        ],
        axis=-1,
    )


def called(code: Compiled, function: Function, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (calls, joints, columns) and bits (calls, joints); the function returns the latter together."""
    with np.errstate(over="ignore"):  # 1e300 becomes infinite in single precision
        found, returned = code(function, *arguments(function, rows))
    np.testing.assert_array_equal(returned, np.bitwise_or.reduce(found["flags"], axis=1))
    return numbers(found), found["flags"]


def same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a == b) | (np.isnan(a) & np.isnan(b))


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", slow_but({"3R"}, ROBOTS))
def test_nothing_leaves_unnoticed_and_nothing_is_invented(name: str, tmp_path: Path) -> None:
    robot = ROBOTS[name]
    wanted = list(functions(robot))
    codes = [compiled_robot(tmp_path / each, robot, wanted, each) for each in ("double", "float")]
    for function in wanted:
        clean = entries(function, robot)
        depends = dependent(codes[0], function, clean)
        for code in codes:
            check_injected(code, function, clean, depends)


def dependent(code: Compiled, function: Function, clean: np.ndarray) -> np.ndarray:
    """Which results each entry has an influence on, (entries, joints, columns)."""
    expected, _ = called(code, function, clean[None])
    others, _ = called(code, function, changed(clean, np.outer(FACTORS, clean)))
    return ~same(others, expected).reshape(len(FACTORS), len(clean), *expected.shape[1:]).all(axis=0)


def check_injected(code: Compiled, function: Function, clean: np.ndarray, depends: np.ndarray) -> None:
    expected, bits = called(code, function, clean[None])
    assert not np.any(bits & STOPS), "a call that goes well"
    for bad in BAD:
        found, flags = called(code, function, changed(clean, np.array([[bad]])))
        lost = ~np.isfinite(found) & np.isfinite(expected)
        unnoticed = lost.any(axis=-1) & (flags & STOPS == 0)
        assert not unnoticed.any(), (function.name, bad, np.argwhere(unnoticed))
        moved = ~depends & np.isfinite(expected) & (found != expected)
        assert not moved.any(), (function.name, bad, np.argwhere(moved))
        invented = depends & np.isnan(bad) & ~np.isnan(found)
        assert not invented.any(), (function.name, bad, np.argwhere(invented))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mixed", slow("sinh")])
def test_all_that_computes_agrees_on_what_is_not_finite(name: str, tmp_path: Path) -> None:
    """NumPy, the compiled engine, and the generated code."""
    robot = ROBOTS[name]
    function = inverse_dynamics_function(robot)
    rows = changed(entries(function, robot), np.array(BAD[:3])[:, None])
    (command,) = arguments(function, rows)
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "double")(function, command)
    with np.errstate(all="ignore"):
        by_numpy = motor_torques(robot, motion_of(command))
    compiled = choose_engine("c", InverseDynamics(robot), len(rows)).engine
    by_c = motor_torques(robot, motion_of(command), engine=compiled)
    for name_of, values in found.items():
        for block in (by_numpy, by_c):
            expected = expected_of(block, name_of)
            np.testing.assert_array_equal(np.isfinite(values), np.isfinite(expected), err_msg=name_of)
        np.testing.assert_array_equal(by_numpy.flags, by_c.flags)
    np.testing.assert_array_equal(found["flags"], by_numpy.flags)
    not_finite = int(Flag.NOT_FINITE | Flag.INFEASIBLE)
    assert {int(bits) & not_finite for bits in found["flags"].flat} <= {0, 1, not_finite}


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_compilers_that_would_not_notice_are_refused(flag: str, tmp_path: Path) -> None:
    write_files(generate(ROBOTS["prismatic"]), tmp_path)
    with pytest.raises(AssertionError, match="compile without -ffast-math and -ffinite-math-only"):
        compile_c(tmp_path, *STRICT, flag, "-c", "rp_2.c", compiler=COMPILERS[-1])
