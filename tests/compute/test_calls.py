"""Calls: what is called alike is recorded and compiled once, and computes what is written out in full."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from samples.engines import demands, random_wrench
from samples.generated_code import compile_c
from samples.long_chains import mixed_chain, random_chain
from samples.marks import needs_compiler, slow
from samples.shipped import shipped_robot
from samples.trees import hand

from vsacli import Robot
from vsacli.compute.control_flow import Keyed, call, repeat
from vsacli.compute.engine import NUMPY, choose_engine
from vsacli.compute.engine.compiler import FLAGS, Library
from vsacli.compute.engine.engines import Kernel, TracedEngine, kernel_program
from vsacli.compute.engine.lanes import batch_source
from vsacli.compute.tracing import Kind, Program, is_of_calls, trace
from vsacli.compute.tracing.calls import MOST_OUTLINED
from vsacli.compute.tracing.row_functions import CallingRowFunction
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import InverseDynamics

EXACT = ("-O0", "-ffp-contract=off")
"""Quickly compiled; products and sums are not contracted, which depends on what lies in one function."""


class Pair(NamedTuple):
    first: Any
    second: Any


def bodies(program: Program) -> list[Program]:
    calls = (symbol.operands[0] for symbol in program.operations if symbol.operation == "call")
    return list({id(each.body): each.body for each in calls}.values())


def recorded(function: Any, inputs: int = 2) -> Program:
    return trace(function, [Kind.REAL] * inputs, calling=True)


def scaled(pair: Pair, factor: Any) -> Pair:
    return Pair(pair.first * factor, pair.second)


def test_calls_with_other_rows_share_a_body():
    def twice(rows: Sequence[Any]) -> list[Any]:
        x, y = rows
        first = call(x, scaled, Pair(x, y), 3.0)
        return [call(x, scaled, first, 3.0).first, call(x, scaled, Pair(y, x), 3.0).first]

    program = recorded(twice)
    assert len(bodies(program)) == 1
    assert [symbol.operation for symbol in program.operations].count("call") == 3


def test_bodies_that_differ_in_constants_are_given_these():
    def two(rows: Sequence[Any]) -> list[Any]:
        x, y = rows
        return [call(x, scaled, Pair(x, y), factor).first for factor in (3.0, 4.0)]

    program = recorded(two)
    (body,) = bodies(program)
    assert len(body.inputs) == 2
    assert [symbol.operands[-1] for symbol in program.operations if symbol.operation == "call"] == [3.0, 4.0]


@pytest.mark.parametrize(("factors", "count"), [((3.0, 0), 1), ((3.0, 1), 1), ((2, 2.0), 1), ((3.0, 3.0), 1)])
def test_exact_constants_decide_on_what_is_recorded(factors: tuple[float, float], count: int):
    """0 and 1 leave no operation, so no body."""

    def two(rows: Sequence[Any]) -> list[Any]:
        x, y = rows
        return [call(x, scaled, Pair(x, y), factor).first for factor in factors]

    assert len(bodies(recorded(two))) == count


def test_constants_of_loops_are_given_to_them():
    def root(x: Any, number: float) -> Any:
        def step(state: Any, _constants: Any) -> Any:
            (guess,) = state
            following = (guess + number / guess) / 2
            return (following,), following == guess

        (found,) = repeat(step, (x,), (), 50)
        return found

    def roots(rows: Sequence[Any]) -> list[Any]:
        return [call(rows[0], root, rows[0], number) for number in (2.0, 3.0)]

    (body,) = bodies(recorded(roots, 1))
    assert [symbol.operation for symbol in body.operations] == ["loop", "item"]
    assert len(body.inputs) == len(body.operations[0].operands) - 1 == 2


def test_what_passes_through_is_not_copied():
    program = recorded(lambda rows: list(call(rows[0], scaled, Pair(*rows), 1)))
    assert program.operations == ()
    assert program.outputs == program.inputs


def test_operations_between_calls_go_into_bodies_of_bounded_size():
    def powers(rows: Sequence[Any]) -> list[Any]:
        x, y = rows
        for _ in range(600):
            x, y = x * y, x + y
        return [x, call(x, scaled, Pair(x, y), 3.0).first]

    program = recorded(powers)
    assert {symbol.operation for symbol in program.operations} == {"call", "item"}
    assert max(len(body.operations) for body in bodies(program)) == MOST_OUTLINED


def test_functions_are_told_apart_by_their_keys():
    def two(keys: Sequence[str]) -> int:
        functions = [Keyed(key, lambda x, number=number: x**number) for number, key in enumerate(keys, 3)]
        return len(
            bodies(recorded(lambda rows: [call(rows[0], function, rows[0]) for function in functions], 1))
        )

    assert [two("ab"), two("aa")] == [2, 1]


def test_of_numpys_rows_the_function_is_called():
    x = np.arange(3.0)
    assert call(x, scaled, Pair(x, 1), 2).first.tolist() == [0.0, 2.0, 4.0]


def program_of(kernel: Kernel, *, calling: bool) -> Program:
    return trace(kernel, [Kind.REAL] * kernel.inputs, calling=calling)


def library(kernel: Kernel, folder: Path, *, calling: bool) -> Library:
    name = f"calling_{calling}"
    (folder / f"{name}.c").write_text(batch_source(program_of(kernel, calling=calling)))
    flags = [flag for flag in FLAGS if not flag.startswith(("-O", "-ffp"))]
    compile_c(folder, *flags, *EXACT, f"{name}.c", "-o", f"{name}.so", "-lm")
    return Library(folder / f"{name}.so", kernel.outputs)


def on_a_large_stack(function: Callable[[], np.ndarray]) -> np.ndarray:
    """Each value that is written out in one piece has a place there if nothing is optimized."""
    usual = threading.stack_size(2**29)
    try:
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(function).result()
    finally:
        threading.stack_size(usual)


def rows_of(kernel: InverseDynamics, samples: int) -> list[np.ndarray]:
    frame = kernel.frame
    motion = demands(kernel.robot, samples, wrench=None if frame is None else random_wrench(samples, frame))
    return kernel.arguments.pack(
        {name: np.ascontiguousarray(array.T) for name, array in motion.variables().items()}
    )


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize(
    ("joints", "frame"),
    [
        (1, None),
        (2, "base"),
        (5, "end_effector"),
        pytest.param(30, None, marks=pytest.mark.exhaustive),
    ],
)
def test_code_of_calls_computes_the_same_bit_for_bit(joints: int, frame: str | None, tmp_path: Path):
    kernel = InverseDynamics(mixed_chain(joints), frame)
    rows = rows_of(kernel, 50)
    written_out, called = (library(kernel, tmp_path, calling=calling) for calling in (False, True))
    expected, found = on_a_large_stack(lambda: written_out(rows, 1)), called(rows, 1)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


@pytest.mark.parametrize(
    "kernel",
    [
        LinkTorques(mixed_chain(3, seed=3)),
        slow(LinkTorques(mixed_chain(7))),
        slow(InverseDynamics(shipped_robot("lwr_7r_vsa"))),
    ],
    ids=["three", "links", "whole"],
)
def test_rows_go_through_calls_as_through_the_text_bit_for_bit(kernel: LinkTorques | InverseDynamics):
    """On some rows longer and on some shorter than those that the workspace was made for."""
    whole = InverseDynamics(kernel.robot)
    function = CallingRowFunction(program_of(kernel, calling=True))
    workspace = function.workspace(60)
    for samples in (60, 23):
        rows = rows_of(whole, samples)[: kernel.inputs]
        found = np.empty((kernel.outputs, samples))
        function(rows, found, workspace)
        np.testing.assert_array_equal(found, NUMPY.run(kernel, rows))


@pytest.mark.slow
def test_long_chains_are_traced_by_calls_for_rows():
    kernel = LinkTorques(mixed_chain(12, seed=3))
    rows = rows_of(InverseDynamics(kernel.robot), 5)[: kernel.inputs]
    assert is_of_calls(kernel_program(kernel))
    np.testing.assert_array_equal(TracedEngine().run(kernel, rows), NUMPY.run(kernel, rows))


@needs_compiler
@pytest.mark.slow
def test_links_of_a_long_chain_agree_with_numpy():
    """To what rounding of 1e-16 becomes over 100 joints, with sines of the C library and of NumPy."""
    kernel = LinkTorques(random_chain(100))
    rows = list(np.random.default_rng(1).uniform(-1, 1, (kernel.inputs, 50)))
    expected = NUMPY.run(kernel, rows)
    found = choose_engine("c", kernel, 1, 2).engine.run(kernel, rows)
    assert (np.abs(found - expected) <= 1e-13 * np.abs(expected).max(axis=0)).all()


@pytest.mark.slow
def test_joints_with_other_constants_need_no_other_code():
    chain = random_chain(6)

    def repeated(times: int) -> Robot:
        joints = [
            replace(joint, name=f"{joint.name}_{mass}", link=replace(joint.link, mass=mass))
            for mass in range(3, 3 + times)
            for joint in chain.joints
        ]
        return replace(chain, joints=tuple(joints))

    twice, thrice = (bodies(program_of(LinkTorques(repeated(times)), calling=True)) for times in (2, 3))
    assert len(twice) == len(thrice)


def length_of_code(kernel: Kernel) -> tuple[int, int]:
    """Operations in all bodies, and calls."""
    program = program_of(kernel, calling=True)
    calls = [symbol for symbol in program.operations if symbol.operation == "call"]
    return sum(len(body.operations) for body in bodies(program)), len(calls)


def links_of_hand(fingers: int, frame: str | None, joints: int = 4) -> LinkTorques:
    robot = hand(fingers, joints)
    if frame is None or fingers == 1:
        return LinkTorques(robot, frame)
    return LinkTorques(robot, (frame,) * fingers)


def run_of_hand(fingers: int, _frame: None) -> BalancedDynamics:
    return BalancedDynamics(InverseDynamics(hand(fingers, 4)))


def test_a_second_finger_adds_no_code_but_the_signs_of_its_wrench():
    """18 operations of its own, and a sum on the wrist of 18; of 2,000."""
    (one, _), (two, _) = (length_of_code(links_of_hand(fingers, "end_effector", 2)) for fingers in (1, 2))
    assert two <= one + 2 * 18


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kernel_of", "frame"),
    [(links_of_hand, None), (links_of_hand, "end_effector"), (links_of_hand, "base"), (run_of_hand, None)],
)
def test_equal_fingers_share_their_code(kernel_of: Callable[[int, str | None], Kernel], frame: str | None):
    """At any mounts; each further finger adds equally many calls."""
    (one, _), (_, of_two), (_, of_three), (five, of_five) = (
        length_of_code(kernel_of(fingers, frame)) for fingers in (1, 2, 3, 5)
    )
    assert five <= 1.1 * one
    assert of_five - of_three == 2 * (of_three - of_two)
