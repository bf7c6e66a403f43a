"""Traced programs on rows: the numbers of the text they were traced from, to the bit but for powers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from samples.shipped import shipped_robot

from vsacli import Robot
from vsacli.compute.control_flow import where_needed
from vsacli.compute.engine import NUMPY, choose_engine
from vsacli.compute.engine.choice import TRACE_FROM
from vsacli.compute.engine.engines import TracedEngine, kernel_program
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.tracing.row_functions import RowFunction
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import InverseDynamics

CLOSED = ("vsa_3r", "lwr_7r_vsa", "rp_2", "mixed_3r", "tendon_1r", "qbmove_arm_gazebo")
"""Robots whose springs need no iteration."""


def demands(robot: Robot, samples: int) -> list[np.ndarray]:
    """Random motion, and stiffness from far too low to high: some steps are infeasible."""
    random = np.random.default_rng(5)
    joints = len(robot.joints)
    motion = list(random.normal(size=(5 * joints, samples)))
    stiffness = list(10 ** random.uniform(-2, 3.5, (joints, samples)))
    return motion + stiffness + list(random.normal(size=(2 * joints, samples)))


@pytest.mark.parametrize("name", CLOSED)
def test_inverse_dynamics_to_the_last_bit(name):
    robot = shipped_robot(name)
    kernel, rows = InverseDynamics(robot), demands(robot, 5000)
    expected, found = NUMPY.run(kernel, rows), TracedEngine().run(kernel, rows)
    assert np.isnan(expected).any()  # infeasible steps, or variables that an actuator does not have
    np.testing.assert_array_equal(found, expected)


def test_any_number_of_samples_at_a_time():
    robot = shipped_robot("vsa_3r")
    kernel, rows = LinkTorques(robot), demands(robot, 9000)[:15]
    expected = NUMPY.run(kernel, rows)
    engine = TracedEngine()
    for start, stop in ((0, 3), (3, 4), (4, 8500), (8500, 9000)):  # the rows kept for more are used for fewer
        found = engine.run(kernel, [row[start:stop] for row in rows])
        np.testing.assert_array_equal(found, expected[:, start:stop])


def test_rows_are_used_again():
    program = kernel_program(LinkTorques(shipped_robot("lwr_7r_vsa")))
    function = RowFunction(program)
    # The forward pass leaves some thirty numbers a joint for the backward pass, and the rest is short-lived.
    assert sum(function.rows.values()) < len(program.operations) / 10


@pytest.mark.slow
def test_a_kernel_with_loops_runs_as_it_is():
    robot = shipped_robot("measured_1r")
    kernel, rows = InverseDynamics(robot), demands(robot, 50)
    with pytest.raises(NotImplementedError, match="has no form on rows"):
        RowFunction(kernel_program(kernel))
    np.testing.assert_array_equal(TracedEngine().run(kernel, rows), NUMPY.run(kernel, rows))


@dataclass(frozen=True)
class Root(RowKernel):
    """Of numbers above zero; of others zero, by a branch in which both stay what they are."""

    arguments = results = RowLayout({"number": ()})

    def __call__(self, rows):
        return where_needed(rows[0] > 0, lambda above: [np.sqrt(above)], rows, [np.zeros_like(rows[0])])


def test_a_kernel_with_branches_runs_as_it_is():
    with pytest.raises(NotImplementedError, match="branch has no form on rows"):
        RowFunction(kernel_program(Root()))
    rows = [np.array([4.0, -1.0])]
    np.testing.assert_array_equal(TracedEngine().run(Root(), rows), [[2.0, 0.0]])


def test_tracing_has_to_repay():
    kernel = LinkTorques(shipped_robot("vsa_3r"))
    assert choose_engine("numpy", kernel, TRACE_FROM - 1).engine is NUMPY
    assert isinstance(choose_engine("numpy", kernel, TRACE_FROM).engine, TracedEngine)
