"""The torques computed for serial actuators move a model that is made from the potential alone."""

from __future__ import annotations

import numpy as np
import pytest
from samples.driven_arm import ARM, LINK, assert_follows
from samples.full_model import Drive, springs_of
from samples.marks import slow, slow_but
from samples.mechanisms import DEVICES

from vsacli import Antagonistic, Elastic, Motor, Rigid, laws, mechanisms
from vsacli.actuators.actuator import Actuator

Case = tuple[Actuator, Drive, tuple[float, float]]
"""An actuator, the same in the full model, and its stiffness at both ends of a motion."""

MOTOR = Motor(inertia=0.2, damping=0.1)
NONE = (np.nan, np.nan)


def of_device(name: str) -> Case:
    device = DEVICES[name]
    return device.actuator, device.drive, device.stiffness


OTHERS: dict[str, Case] = {
    "antagonistic": (
        Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=400, k_c=2000),) * 2),
        Drive(
            np.diag([0.2, 0.2]),
            [0.1, 0.1],
            springs_of(lambda q, *theta: sum(200 * (x - q) ** 2 + 500 * (x - q) ** 4 for x in theta), 2),
        ),
        (900, 1200),
    ),
    "elastic": (
        Elastic(motor=MOTOR, stiffness=800),
        Drive(0.2, [0.1], springs_of(lambda q, theta: 400 * (theta - q) ** 2, 1)),
        NONE,
    ),
    "rigid": (Rigid(motor=MOTOR), Drive(0.2, [0.1]), NONE),
}


@pytest.mark.parametrize("name", slow_but(mechanisms.MECHANISMS, DEVICES))
def test_a_pendulum_follows(name: str) -> None:
    actuator, drive, stiffness = of_device(name)
    assert_follows(LINK, [actuator], [drive], [stiffness])


@pytest.mark.slow
@pytest.mark.parametrize(
    "kinds",
    [
        ("awas", "antagonistic", "elastic"),
        slow(("antagonistic", "awas", "rigid")),
        slow(("rigid", "elastic", "awas")),
    ],
)
def test_an_arm_of_many_kinds_follows(kinds: tuple[str, ...]) -> None:
    actuators, drives, stiffness = zip(*(OTHERS.get(kind) or of_device(kind) for kind in kinds), strict=True)
    assert_follows(ARM, list(actuators), list(drives), list(stiffness))
