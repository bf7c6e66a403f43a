"""Results to draw, held in memory: made by closed forms and by hand, without vsacli's own dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsacli.base.variables import OF_ANY_ROBOT, VARIABLES, Variable
from vsacli.robot.joint import existing_columns

STIFFNESS_K, STIFFNESS_KC, MOTOR_INERTIA = 400.0, 2000.0, 3.2


class Result:
    """What the figures ask of a stored result; it holds the variables it is given."""

    kind, command = "result", "invdyn"
    complete = True
    declared = VARIABLES

    def __init__(
        self,
        time: np.ndarray,
        types: str = "RRR",
        path: str = "run.h5",
        trajectory: str = "rest-to-rest",
        actuators: Sequence[str] | None = None,
        **variables: np.ndarray,
    ) -> None:
        many = tuple(f"joint_{index + 1}" for index in range(len(types)))
        self.path = Path(path)
        self.robot_name = "vsa-3r"
        self.trajectory_name = trajectory
        self.joint_names = ("base", "shoulder", "elbow") if types == "RRR" else many
        self.joint_types = tuple({"R": "revolute", "P": "prismatic"}[letter] for letter in types)
        self.actuators = tuple(actuators or ["antagonistic"] * len(types))
        self.bounds: dict[str, np.ndarray] = {}
        self.report_json: dict[str, Any] = {}
        self.time = time
        self.samples = time.size
        self._values = variables
        self.variables = tuple(name for name in VARIABLES if name in variables)

    def existing(self, variable: Variable) -> np.ndarray:
        return np.array(existing_columns(variable, self.actuators))

    def limits(self, name: str) -> np.ndarray:
        return self.bounds.get(name, np.full((len(self.joint_names), 1, 2), np.nan))

    def has_variable(self, variable: Variable) -> bool:
        return variable.requires in OF_ANY_ROBOT

    def read(self, name: str, start: int = 0, stop: int | None = None) -> np.ndarray:
        return self._values[name][start:stop]


def rest_to_rest(
    samples: int = 401, types: str = "RRR", sigma: Sequence[float] = (850, 1275), **options: object
) -> Result:
    """A motion of cubic springs (K = 400, Kc = 2000) from one stiffness to another in 4 s.

    Where the stiffness is below what the load allows, the step is flagged and its motor torque is NaN.
    """
    time = np.linspace(0, 4, samples)
    s = (time / 4)[:, None]
    joint = np.arange(len(types))
    q = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3) * np.resize([1.57, 0.79, -1.05], len(types))
    stiffness = sigma[0] + (sigma[1] - sigma[0]) * s**2 * (3 - 2 * s) + 0 * joint
    load = np.resize([0.5, -32.0, -7.0], len(types)) * np.cos(q * (1 + joint / 4))
    tau_e = load + np.resize([9.0, 4.0, 1.5], len(types)) * np.sin(2 * np.pi * s) * (s * (1 - s) * 4) ** 2
    lower = smallest_stiffness(tau_e)
    infeasible = stiffness < lower
    tau_motor = motor_torque(time, q, np.where(infeasible, np.nan, stiffness), tau_e)
    values = {
        "q": q,
        "stiffness": stiffness,
        "tau_e": tau_e,
        "tau_motor": tau_motor,
        "stiffness_min": lower,
        "stiffness_max": np.full_like(lower, np.inf),
        "flags": infeasible.astype(np.uint32),
    }
    return Result(time, types, **{**values, **options})


def without(result: Result, *names: str) -> Result:
    result.variables = tuple(name for name in result.variables if name not in names)
    return result


def smallest_stiffness(tau_e: np.ndarray) -> np.ndarray:
    """2K + 6 Kc p^2 with 2 K p + 2 Kc p^3 = |tau_e|, for loads below the fold family."""
    scale = np.sqrt(STIFFNESS_K / (3 * STIFFNESS_KC))
    p = 2 * scale * np.sinh(np.arcsinh(1.5 * np.abs(tau_e) / (2 * STIFFNESS_K * scale)) / 3)
    return 2 * STIFFNESS_K + 6 * STIFFNESS_KC * p**2


def motor_torque(time: np.ndarray, q: np.ndarray, stiffness: np.ndarray, tau_e: np.ndarray) -> np.ndarray:
    """Closed-form deflections, accelerations by differences; (samples, joints, 2)."""
    argument = 3 * np.sqrt(3 * STIFFNESS_KC) * tau_e / stiffness**1.5
    total = 2 * np.sqrt(stiffness / (3 * STIFFNESS_KC)) * np.sin(np.arcsin(argument) / 3)
    apart = np.sqrt(2 * (stiffness - 2 * STIFFNESS_K) / (3 * STIFFNESS_KC) - total**2)
    phi = np.stack([total + apart, total - apart], axis=-1) / 2
    acceleration = np.gradient(np.gradient(phi + q[..., None], time, axis=0), time, axis=0)
    return MOTOR_INERTIA * acceleration + STIFFNESS_K * phi + STIFFNESS_KC * phi**3
