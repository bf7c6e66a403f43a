"""Generated code of robots with dampers: what moves inside transmissions goes in and comes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.driven_arm import LINK, motion_of, robot_of
from samples.generated_code import Compiled, compile_c, write_files
from samples.marks import needs_compiler
from samples.mechanisms import DEVICES

from vsacli import Antagonistic, Damper, Motor, inverse_dynamics, laws
from vsacli.actuators.actuator import Actuator
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.control.codegen.robot_functions import inverse_dynamics_function

MOTOR = Motor(inertia=0.2, damping=0.1)
ACTUATORS: dict[str, tuple[Actuator, tuple[float, float]]] = {
    "antagonistic": (
        Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=400, k_c=2000),) * 2),
        (900, 1200),
    ),
    "awas": (DEVICES["awas"].actuator, DEVICES["awas"].stiffness),
}


@needs_compiler
@pytest.mark.parametrize("location", ["link", "transmission"])
@pytest.mark.parametrize("name", ACTUATORS)
def test_it_gives_the_torques_of_a_run(name: str, location: str, tmp_path: Path) -> None:
    actuator, stiffness = ACTUATORS[name]
    robot = robot_of(LINK, [actuator], [Damper(location=location, range=(1, 10))])
    trajectory = motion_of([stiffness], [(2, 8)])
    run = inverse_dynamics(robot, trajectory)
    project, prefix = generate(robot), prefix_of(robot)
    write_files(project, tmp_path)
    function = inverse_dynamics_function(robot)
    command = {array.name: getattr(run, array.name)[::50] for array in function.arguments[0][1].arrays}
    state = np.where(np.isnan(run.phi), run.theta, run.phi)[::50]
    inside = [{"internal_phi": state}] if location == "transmission" else []
    found, flags = Compiled(tmp_path, prefix)(function, command, *inside)
    assert not any(flags)
    atol = 1e-9 * np.abs(run.tau_motor).max()  # rates by the equation here, by the polynomial there
    np.testing.assert_allclose(found["tau_motor"], run.tau_motor[::50], rtol=0, atol=atol)
    if location == "transmission":
        rates = np.where(np.isnan(run.dphi), run.dtheta, run.dphi)[::50]
        np.testing.assert_allclose(found["dinternal_phi"], rates, rtol=0, atol=1e-10)
        assert project.omitted[0].startswith("no feedback_linearization: feedback linearization sets")
    compile_c(tmp_path, "-std=c99", f"{prefix}.c", f"{prefix}_test.c", "-o", "self_test", "-lm")
