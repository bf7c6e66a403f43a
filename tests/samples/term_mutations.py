"""Formulas of inverse dynamics with one term off by 1 %, or of the wrong sign, and motions that need it."""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import pytest

from samples.robots import random_robot
from samples.shipped import shipped_run
from vsacli import (
    Antagonistic,
    Damper,
    Elastic,
    Friction,
    Motor,
    Rigid,
    Robot,
    Serial,
    Trajectory,
    laws,
    mechanisms,
)

Run = tuple[Robot, Trajectory]


class Mutation(NamedTuple):
    """A change of one term.

    Attributes:
        term: as the theory names it.
        run: name in `RUNS` of the motion in which it counts.
        home: module and function, `vsacli.` left out.
        old: the term in the source.
        new: what takes its place.
    """

    term: str
    run: str
    home: str
    old: str
    new: str

    def apply(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Put the function with the changed term in place of the right one, wherever that was imported."""
        module_name, _, path = self.home.partition(":")
        module = import_module(f"vsacli.{module_name}")
        *owners, name = path.split(".")
        owner: Any = vars(module)[owners[0]] if owners else module
        original = vars(owner)[name]
        function: Any = original.fget if isinstance(original, property) else original
        source = textwrap.dedent(inspect.getsource(function))
        assert source.count(self.old) == 1, f"{self.home} has {source.count(self.old)} times {self.old!r}"
        space = dict(vars(module))
        exec("from __future__ import annotations\n" + source.replace(self.old, self.new), space)
        users = [owner] if owners else _users_of(name, original)
        for user in users:
            monkeypatch.setattr(user, name, space[name])


def _users_of(name: str, function: Any) -> list[Any]:
    """The modules that have a function under its name."""
    modules = [module for key, module in sys.modules.items() if key.startswith("vsacli")]
    return [module for module in modules if vars(module).get(name) is function]


PAIR, MATRIX = "actuators.pairs.pair_springs:PairSprings", "actuators.elasticity:MotorMatrix"
BETA = f"{PAIR}.motor_accelerations"
CURVATURE = f"{PAIR}.stiffness_curvature"
DRIVE, TORQUES = "dynamics.drive:drive_without_limits", "dynamics.drive:shaft_torques"
FRICTION, WINDINGS = "actuators.friction:FrictionLaws", "actuators.motor:Windings.variables"
RATIO, STATE = (
    "actuators.mechanisms.ratios.ratio:ratio_partials",
    "actuators.mechanisms.mechanism:DeflectionState",
)
CUBIC, LOSS = "actuators.laws.cubic:Cubic", "dynamics.losses:dissipated_power"
DAMPER, ELASTIC = "dynamics.drive:_damper_torques", "actuators.elastic:Elastic.transmit"
SINGLE = "actuators.single_springs:SingleSpring"

MUTATIONS = (
    Mutation("tau_k (62)", "pair", f"{CUBIC}.torque", "return phi", "return 1.01 * phi"),
    Mutation(
        "tau_k (62), by the motor alone",
        "pair",
        f"{PAIR}.tau_transmission",
        "return self._spring_1.tau, ",
        "return 1.01 * self._spring_1.tau, ",
    ),
    Mutation("sigma_k (63)", "pair", f"{CUBIC}.stiffness", "3 * self", "3.03 * self"),
    Mutation("zeta_k (64)", "pair", f"{CUBIC}.slope", "6 *", "6.06 *"),
    Mutation("eta_k (66)", "pair", f"{CUBIC}.curvature", "6 *", "6.06 *"),
    Mutation("energy of a spring", "pair", f"{CUBIC}.energy", "self.k / 2", "1.01 * self.k / 2"),
    Mutation(
        "det A (67), its first product",
        "pair",
        f"{MATRIX}.__init__",
        "= torque_1 * stiff",
        "= 1.01 * torque_1 * stiff",
    ),
    *(
        Mutation(f"A^-1 (68), (72), {place}", "pair", f"{MATRIX}.solve", old, f"1.01 * {old}")
        for place, old in {
            "zeta_2 in row 1": "self.stiffness_2 * torque_row",
            "sigma_2 in row 1": "self.torque_2 * stiffness_row",
            "sigma_1 in row 2": "self.torque_1 * stiffness_row",
            "zeta_1 in row 2": "self.stiffness_1 * torque_row",
        }.items()
    ),
    Mutation(
        "phi_k + q (69)",
        "pair",
        "actuators.actuator:Actuator.motor_positions",
        "unknowns + q",
        "unknowns + 1.01 * q",
    ),
    *(
        Mutation(f"{term} in ({70 + row})", "pair", BETA, old, new)
        for row, term, old, new in (
            (0, "tau_e''", "ddtau_e - ", "1.01 * ddtau_e - "),
            (0, "zeta_1 phi_1'^2", "= spring_1.zeta * (", "= 1.01 * spring_1.zeta * ("),
            (0, "zeta_2 phi_2'^2", "+ spring_2.zeta * (", "+ 1.01 * spring_2.zeta * ("),
            (0, "sigma q''", "self.stiffness * ddq", "1.01 * self.stiffness * ddq"),
            (1, "sigma''", "ddstiffness - ", "1.01 * ddstiffness - "),
            (
                1,
                "zeta q''",
                "(spring_1.zeta + spring_2.zeta) * ddq",
                "1.01 * (spring_1.zeta + spring_2.zeta) * ddq",
            ),
        )
    ),
    *(
        Mutation(f"eta_{side} phi_{side}'^2 in (71)", "pair", CURVATURE, term, f"1.01 * {term}")
        for side, term in ((1, "self._spring_1.eta"), (2, "self._spring_2.eta"))
    ),
    Mutation(
        "B_k theta_k'' (73)-(74)",
        "pair",
        "dynamics.drive:_rotor_torques",
        "for motor in actuator.motors]) * ddtheta",
        "for motor in actuator.motors]) * (1.01 * ddtheta)",
    ),
    Mutation(
        "D_m,k theta_k' (73)-(74)", "pair", TORQUES, "motor_damping * dtheta", "1.01 * motor_damping * dtheta"
    ),
    Mutation("tau_k (73)-(74)", "pair", TORQUES, "+ tau_transmission", "+ 1.01 * tau_transmission"),
    Mutation(
        "B_12 theta_k''",
        "serial",
        "dynamics.drive:_rotor_torques",
        "own_torques + coupling",
        "own_torques + 1.01 * coupling",
    ),
    Mutation(
        "B_12 theta_k'', sign",
        "serial",
        "dynamics.drive:_rotor_torques",
        "own_torques + coup",
        "own_torques - coup",
    ),
    Mutation(
        "spring between the motors",
        "pair",
        f"{PAIR}.tau_transmission",
        "tau + coupling_torque",
        "tau + 1.01 * coupling_torque",
    ),
    Mutation("motor friction", "pair", TORQUES, "+ friction.torque", "+ 1.01 * friction.torque"),
    Mutation("motor friction, sign", "pair", TORQUES, "+ friction.torque", "- friction.torque"),
    Mutation("Coulomb friction", "pair", f"{FRICTION}.torque", "return self", "return 1.01 * self"),
    Mutation("friction offset", "pair", f"{FRICTION}.torque", "self.offset", "1.01 * self.offset"),
    Mutation("friction width", "pair", f"{FRICTION}.torque", "np.tanh(velocity", "np.tanh(1.01 * velocity"),
    Mutation(
        "friction direction",
        "pair",
        f"{FRICTION}._coulomb_friction",
        "self.backward, self.forward",
        "self.forward, self.backward",
    ),
    Mutation("current", "pair", WINDINGS, "torque / self", "1.01 * torque / self"),
    Mutation(
        "voltage, R i", "pair", WINDINGS, "self.resistance * current +", "1.01 * self.resistance * current +"
    ),
    Mutation("voltage, of the velocity", "pair", WINDINGS, "* velocity", "* (1.01 * velocity)"),
    Mutation("copper loss", "pair", WINDINGS, "current * current", "current * (1.01 * current)"),
    Mutation(
        "motor power",
        "pair",
        DRIVE,
        "tau_motor * transmission.dtheta",
        "1.01 * tau_motor * transmission.dtheta",
    ),
    Mutation(
        "dissipated power, joint",
        "pair",
        LOSS,
        "_lost_power(joint.damping",
        "_lost_power(1.01 * joint.damping",
    ),
    Mutation(
        "dissipated power, motors",
        "pair",
        LOSS,
        "motor.damping, FrictionLaws",
        "1.01 * motor.damping, FrictionLaws",
    ),
    Mutation(
        "friction between links",
        "pair",
        "dynamics.dry_friction:joint_friction",
        "tau=mul(coulomb, tanh)",
        "tau=mul(coulomb, tanh * 1.01)",
    ),
    Mutation(
        "damper between links",
        "pair",
        "dynamics.dampers:damper_torque",
        "tau=mul(d, v)",
        "tau=mul(d, v * 1.01)",
    ),
    Mutation(
        "tau_damper between links", "pair", DAMPER, "damping * command.dq", "1.01 * damping * command.dq"
    ),
    Mutation("damper parallel to springs", "damped", DAMPER, "damping * rate if", "1.01 * damping * rate if"),
    Mutation(
        "damper parallel to springs, velocity",
        "damped",
        "actuators.damped_springs:DampedSprings.damper_motion",
        "command.tau_e - springs",
        "1.01 * command.tau_e - springs",
    ),
    Mutation("T (mechanism)", "serial", RATIO, "T=value", "T=1.01 * value"),
    Mutation("U_s (mechanism)", "serial", RATIO, "setting_torque=slope", "setting_torque=1.01 * slope"),
    Mutation("T_p (mechanism)", "serial", RATIO, "T_p=value", "T_p=1.01 * value"),
    Mutation("T_s (mechanism)", "serial", RATIO, "T_s=slope", "T_s=1.01 * slope"),
    *(
        Mutation(f"{name} (mechanism)", "serial", RATIO, f"{name}=", f"{name}=1.01 * ")
        for name in ("T_pp", "T_ps", "T_ss", "T_ppp", "T_pps", "T_pss")
    ),
    Mutation("energy (mechanism)", "serial", RATIO, "energy=value", "energy=1.01 * value"),
    Mutation(
        "torque against motor 2",
        "serial",
        f"{STATE}.tau_transmission",
        "self._partials.setting",
        "1.01 * self._partials.setting",
    ),
    Mutation(
        "theta_1'' = phi'' + q''",
        "serial",
        f"{STATE}.motor_accelerations",
        "ddphi + ddq",
        "ddphi + 1.01 * ddq",
    ),
    Mutation("phi'', one motor", "spring", ELASTIC, "=ddphi + command", "=1.01 * ddphi + command"),
    Mutation(
        "zeta phi'^2, one motor",
        "spring",
        f"{SINGLE}.motor_accelerations",
        "- self._spring.zeta",
        "- 1.01 * self._spring.zeta",
    ),
    Mutation("sigma phi' = tau_e', one motor", "spring", f"{SINGLE}.rates", "(dtau_e /", "(1.01 * dtau_e /"),
    Mutation(
        "tau_e'', one motor", "spring", f"{SINGLE}.motor_accelerations", "((ddtau_e -", "((1.01 * ddtau_e -"
    ),
    Mutation(
        "torque of one motor", "spring", f"{SINGLE}.tau_transmission", "(self._spring", "(1.01 * self._spring"
    ),
    Mutation(
        "tau_e, rigid",
        "spring",
        "actuators.rigid:Rigid.transmit",
        "tau_transmission=command",
        "tau_transmission=1.01 * command",
    ),
    Mutation(
        "q'', rigid",
        "spring",
        "actuators.rigid:Rigid.transmit",
        "ddtheta=command.ddq",
        "ddtheta=1.01 * command.ddq",
    ),
)


def _motor(inertia: float, **further: Any) -> Motor:
    return Motor(inertia=inertia, damping=0.4, **further)


def _pair(coupled: bool) -> Antagonistic:
    friction = Friction(coulomb=(0.8, 1.2), offset=0.3, width=0.05)
    sharp = Friction(coulomb=(0.6, 1.1))
    electrical = {"torque_constant": 0.05, "resistance": 0.4, "gear_ratio": 50.0, "side": "shaft"}
    geared = {"coulomb": (0.02, 0.03), "offset": 0.005, "width": 2.0}
    motors = (
        Motor(inertia=2e-4, damping=1e-4, friction=Friction(**geared), **electrical),  # type: ignore[arg-type]
        _motor(0.6, friction=sharp if coupled else friction),
    )
    springs = (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=500, k_c=2500))
    return Antagonistic(motor=motors, spring=springs, coupling=laws.Cubic(k=60, k_c=200) if coupled else None)


def _motion(robot: Robot, stiffness: tuple[float, float]) -> Trajectory:
    """A second of sines, fast enough that every term counts."""
    time = np.arange(501) / 500
    phase = np.arange(len(robot.joints))
    q = 0.4 * np.sin(5 * time[:, None] + phase)
    low, high = stiffness
    varied = low + (high - low) * (1 + np.sin(4 * time[:, None] + phase)) / 2
    return Trajectory.from_samples(time, q, varied, fit="interpolate")


def _pairs() -> Run:
    robot = random_robot("RP", 3)
    first, second = robot.joints
    joints = (
        replace(
            first,
            actuator=_pair(coupled=False),
            friction=Friction(coulomb=(0.7, 0.7), width=0.1),
        ),
        replace(second, actuator=_pair(coupled=True), damper=Damper(location="link", range=(2.0, 2.0))),
    )
    robot = replace(robot, joints=joints, gravity=(0.0, -2.0, 1.0))
    return robot, _motion(robot, (3000.0, 4000.0))


def _serial() -> Run:
    motors = _motor(0.3), _motor(0.02)
    robot = random_robot("R", 4)
    awas = mechanisms.Awas(k=50000, arm=(0.02, 0.12), lead=0.01)
    actuator = Serial(motor=motors, coupled_inertia=0.03, mechanism=awas)
    robot = replace(robot, joints=(replace(robot.joints[0], actuator=actuator),), gravity=(0.0, -2.0, 1.0))
    return robot, _motion(robot, (400.0, 800.0))


def _springs() -> Run:
    robot = random_robot("RRR", 5)
    actuators = (
        Elastic(motor=_motor(0.5), spring=laws.Cubic(k=400, k_c=20000)),
        Elastic(motor=_motor(0.5), stiffness=900.0),
        Rigid(motor=_motor(0.5)),
    )
    joints = (replace(joint, actuator=each) for joint, each in zip(robot.joints, actuators, strict=True))
    robot = replace(robot, joints=tuple(joints), gravity=(0.0, -2.0, 1.0))
    time = np.arange(501) / 500
    q = 0.4 * np.sin(5 * time[:, None] + np.arange(3))
    return robot, Trajectory.from_samples(time, q, fit="interpolate")


_RUNS: dict[str, Callable[[], Run]] = {
    "pair": _pairs,
    "serial": _serial,
    "spring": _springs,
    "damped": lambda: shipped_run("compact_1r", "compact_1r"),
}


@cache
def mutated_run(name: str) -> Run:
    """Robot and trajectory by the name that a mutation has for them."""
    return _RUNS[name]()
