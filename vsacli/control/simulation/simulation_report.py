"""The verdict on a simulation: one object, rendered as text and as JSON, and stored in the file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.analysis.joint_report import Worst
from vsacli.analysis.report import VERDICTS
from vsacli.base.arrays import FloatArray, by_joint, of_joint
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.base.json_records import Stored, named
from vsacli.base.simulation_variables import actual
from vsacli.control.simulation.history import History
from vsacli.dynamics.energy import EnergyMeter, Flow, JointEnergy
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.model import Joint, Robot

_VERDICT_OF = {"over_limit": LIMITS, "singular": Flag.SINGULAR, "infeasible": Flag.INFEASIBLE | Flag.SLACK}


@dataclass(frozen=True)
class Deviation(Stored):
    """Of an actual value from the command: the largest, when (s), and the last; NaN if there is none."""

    peak: float
    time: float
    final: float

    @classmethod
    def of(cls, time: FloatArray, error: FloatArray) -> Deviation:
        """From errors, (samples,), at times."""
        if np.isnan(error).all():
            return cls(np.nan, np.nan, np.nan)
        worst = int(np.nanargmax(np.abs(error)))
        return cls(float(abs(error[worst])), float(time[worst]), float(error[-1]))


@dataclass(frozen=True)
class JointTracking(Stored):
    """What a simulation found at one joint.

    Attributes:
        name: of the joint.
        type: "revolute" or "prismatic".
        q: deviation of the position, rad (m).
        stiffness: deviation of the stiffness, N m/rad (N/m).
        peak_tau_motor: largest |torque| that motors 1 and 2 gave, N m (N).
        steps_over_limit: how many steps have a limit exceeded.
        worst: the worst excess of each limit, by its name.
        energy: work of the motors, elastic energy, co-contraction.
    """

    name: str
    type: str
    q: Deviation
    stiffness: Deviation
    peak_tau_motor: tuple[float, float]
    steps_over_limit: int
    worst: dict[str, Worst]
    energy: JointEnergy

    shape: ClassVar = {
        **named("name", "type"),
        "q_error": "q",
        "stiffness_error": "stiffness",
        "peak": {"tau_motor": "peak_tau_motor"},
        "steps": {"over_limit": "steps_over_limit"},
        **named("worst", "energy"),
    }


def joint_trackings(robot: Robot, history: History) -> tuple[JointTracking, ...]:
    """What a history says about each joint."""
    energies = enumerate(_energies(robot, history))
    return tuple(_tracking(robot.joints[index], index, history, energy) for index, energy in energies)


def _energies(robot: Robot, history: History) -> list[JointEnergy]:
    time, work, power, tau_spring, elastic_energy = (
        _led(getattr(history, name))
        for name in ("time", *map(actual, ("motor_energy", "motor_power", "tau_spring", "elastic_energy")))
    )
    meter = EnergyMeter()
    meter.add(Flow(np.diff(time), np.diff(work), power, tau_spring, elastic_energy))
    return meter.report(robot)


def _led(values: FloatArray) -> FloatArray:
    """(..., samples + 1) from (samples, ...), the first step twice: a run may end with it."""
    rows = by_joint(values)
    return np.concatenate((rows[..., :1], rows), axis=-1)


def _tracking(joint: Joint, index: int, history: History, energy: JointEnergy) -> JointTracking:
    flags = history.flags[:, index]
    first, second = np.fmax.reduce(np.abs(history.tau_motor_actual[:, index]), axis=0).tolist()
    return JointTracking(
        name=joint.name,
        type=joint.type,
        q=Deviation.of(history.time, history.q_error[:, index]),
        stiffness=Deviation.of(history.time, history.stiffness_error[:, index]),
        peak_tau_motor=(first, second),
        steps_over_limit=int(np.count_nonzero(has(flags, LIMITS))),
        worst=_worst(joint, index, history),
        energy=energy,
    )


def _worst(joint: Joint, index: int, history: History) -> dict[str, Worst]:
    """The worst excess of each limit of a joint; of either motor."""
    worst: dict[str, Worst] = {}
    most: dict[str, float] = {}
    checks = limit_checks(joint)
    names = {check.variable: _checked(check.variable) for check in checks}
    values = of_joint({variable: getattr(history, name) for variable, name in names.items()}, index)
    for check in checks:
        excess, label = check.worst(values, history.flags[:, index]), check.flag.label
        if excess is not None and excess.size > most.get(label, 0.0):
            time, unit = float(history.time[excess.step]), check.unit(joint.type)
            worst[label] = Worst(label, time, excess.value, excess.bound, unit, check.motor)
            most[label] = excess.size
    return worst


def _checked(variable: str) -> str:
    """Where the values lie that a limit bounds: of the torque what is asked for, else what was."""
    return variable if variable == "tau_motor" else actual(variable)


def verdict_on(history: History, *, complete: bool) -> str:
    """The worst of `VERDICTS` that a flag of any step speaks for, or "diverged" if none explains the end."""
    flags = int(np.bitwise_or.reduce(history.flags, axis=None))
    applies = {verdict for verdict, bits in _VERDICT_OF.items() if flags & bits}
    worst = next((verdict for verdict in reversed(VERDICTS) if verdict in applies), "ok")
    return worst if complete or worst not in ("ok", "over_limit") else "diverged"


@dataclass(frozen=True)
class SimulationReport(Stored):
    """The verdict on a simulation.

    Attributes:
        robot: name of the robot.
        trajectory: name of the trajectory.
        controller: in words, as typed.
        samples: steps stored.
        duration: time from the first to the last step of the trajectory, s.
        verdict: the worst of `VERDICTS` that applies, or "diverged"; see `verdict_on`.
        ending: why it ended early, as a sentence; None if it did not.
        evaluations: of the equations of motion.
        warnings: why the inputs may not be what was meant.
        notes: how they were understood, where that is not obvious.
        joints: one report a joint.
        with_full_state: deviation of q of each joint in the same run when the controller knows the full state
            at every instant; empty unless positions alone are measured.
    """

    robot: str
    trajectory: str
    controller: str
    samples: int
    duration: float
    verdict: str
    ending: str | None
    evaluations: int
    joints: tuple[JointTracking, ...]
    warnings: tuple[str, ...]
    with_full_state: tuple[Deviation, ...]
    notes: tuple[str, ...] = ()

    format: ClassVar = "vsacli-simulation-report/1"
    shape: ClassVar = named(
        *("format", "verdict", "robot", "trajectory", "controller", "samples", "duration", "complete"),
        *("ending", "evaluations", "warnings", "notes", "joints", "with_full_state"),
    )

    @property
    def complete(self) -> bool:
        """Whether the run reached the end of the trajectory."""
        return self.ending is None
