"""Generated functions that are long, and so call others, beside those that are written out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import commands, with_springs
from samples.generated_code import compiled_robot
from samples.long_chains import mixed_chain
from samples.marks import needs_compiler
from samples.shipped import shipped_robot

from vsacli import Robot
from vsacli.control.codegen import interface
from vsacli.control.codegen.cost import table_bytes, worst_cost
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function

pytestmark = needs_compiler

ROBOTS = {
    "mixed": shipped_robot("mixed_3r"),
    "cubic": with_springs("cubic"),
    "measured": shipped_robot("measured_1r"),
    "chain": mixed_chain(6),
}


@pytest.mark.slow
@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ["mixed", "cubic", "measured", "chain"])
@pytest.mark.parametrize("precision", ["double", "float"])
def test_they_compute_the_same_bit_for_bit(
    name: str, precision: str, tmp_path: Path, most_operations: Callable[[int], None]
) -> None:
    robot = ROBOTS[name]
    found = []
    for folder, most in (("written_out", interface.MOST_WRITTEN_OUT), ("calls", 100)):
        most_operations(most)
        functions = [link_torques_function(robot), inverse_dynamics_function(robot)]
        compiled = compiled_robot(tmp_path / folder, robot, functions, precision)
        found.append(compiled(functions[1], commands(robot, 60, seed=3)))
    (written_out, its_flags), (called, flags) = found
    assert flags == its_flags
    for variable, values in written_out.items():
        np.testing.assert_array_equal(called[variable], values, err_msg=variable)


def test_their_cost_is_that_of_all_calls(most_operations: Callable[[int], None]) -> None:
    def program_of(robot: Robot) -> tuple[int, int]:
        program = link_torques_function(robot).program
        return worst_cost(program).operations, table_bytes([program], "double")

    robot = shipped_robot("lwr_7r_vsa")
    operations, none = program_of(robot)
    most_operations(100)
    assert program_of(robot) == (pytest.approx(operations, rel=0.01), pytest.approx(3000, rel=0.5))
    assert none == 0
