"""A spring law whose methods cannot be recorded: NumPy computes, and C code is refused with the reason."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.codegen import commands, motion_of
from samples.drives import joint_with, springs, with_joint
from samples.marks import needs_compiler
from samples.shipped import shipped_robot

from vsacli import InputError, Robot, laws
from vsacli.compute.engine import choose_engine
from vsacli.control.codegen.project import generate
from vsacli.dynamics.inverse import InverseDynamics, compute_block


@dataclasses.dataclass(frozen=True)
class Masked(laws.Cubic):
    """A cubic spring, written with a mask, which NumPy takes and recording does not."""

    def torque(self, phi: np.ndarray) -> np.ndarray:
        result = self.k * phi
        result[phi != 0] += self.k_c * phi[phi != 0] ** 3
        return result

    def closed_pair(self, _other: laws.SpringLaw) -> laws.Pair | None:
        return None


@pytest.fixture
def robot() -> Robot:
    masked = Masked(k=400, k_c=2000)
    return with_joint(shipped_robot("vsa_3r"), 1, joint_with(springs(masked, masked)))


REASON = "what is known only when the program runs cannot decide what is recorded"


def test_no_c_code_is_made(robot: Robot) -> None:
    with pytest.raises(InputError, match=f"no C code can be made of vsa-3r: inverse_dynamics: {REASON}"):
        generate(robot)


@needs_compiler
def test_the_engine_c_is_refused(robot: Robot) -> None:
    with pytest.raises(InputError, match=f"this cannot be compiled: {REASON}; take the engine numpy"):
        choose_engine("c", InverseDynamics(robot), 1)


@pytest.mark.parametrize("name", ["auto", "numpy"])
def test_numpy_computes(name: str, robot: Robot) -> None:
    choice = choose_engine(name, InverseDynamics(robot), 10_000_000)
    assert choice.reason.startswith("NumPy computes")
    motion = motion_of(commands(robot, 50, seed=1))
    block, expected = (compute_block(robot, motion, **given) for given in ({"engine": choice.engine}, {}))
    np.testing.assert_array_equal(block.tau_motor, expected.tau_motor)
