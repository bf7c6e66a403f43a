"""A Python file with the forces that MJCF cannot express: springs of other laws, and smooth dry friction.

The usual code of these forces is traced, and written by operations, so the file needs only NumPy and MuJoCo.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from vsacli.actuators.friction import Friction, FrictionLaws
from vsacli.actuators.spring_elements import SpringElement
from vsacli.base.errors import InputError, Problem
from vsacli.base.texts import one_line
from vsacli.base.version import __version__
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.robot.models.mjcf_drives import motor_name, robot_file_path, springs_are_expressible

_TEXT = '''"""Passive forces of {name}, by vsacli {version}: {words}.

    model = mujoco.MjModel.from_xml_path(...)
    install(model)

MuJoCo has one such callback for all models; this one leaves others alone. While it is there MuJoCo compiles
no model: mujoco.set_mjcb_passive(None) takes it away.
"""

from numpy import {imports}

JOINTS = {joints}


{function}

def install(model):
    """Add the forces to whatever is simulated with a model, once it is compiled."""
    import mujoco

    joints = [model.joint(name) for name in JOINTS]
    positions = array([joint.qposadr[0] for joint in joints])
    velocities = array([joint.dofadr[0] for joint in joints])

    def passive(its_model, data):
        if its_model.signature == model.signature:
            with errstate(all="ignore"):
                data.qfrc_passive[velocities] += forces(data.qpos[positions], data.qvel[velocities])

    mujoco.set_mjcb_passive(passive)
'''


def check_friction(robot: Robot) -> None:
    """Raise an error for friction whose shape is the sign function.

    Raises:
        InputError: frictions have the width 0; names each, with a fix.
    """
    problems = [
        Problem(
            robot_file_path(robot),
            0,
            f"{where} has the width 0; MuJoCo's frictionloss is another law, which creeps where this one "
            "sticks: give the friction a width",
        )
        for joint in robot.joints
        for where, friction in _named_frictions(joint)
        if friction.sharp
    ]
    if problems:
        raise InputError(problems)


def forces_words(robot: Robot) -> str:
    """Return a phrase on the forces in the file; "" without any."""
    springs = [joint.name for joint in robot.joints if not springs_are_expressible(joint)]
    friction = [joint.name for joint in robot.joints if joint.has_friction]
    parts = {"springs": springs, "friction": friction}
    return "; ".join(f"{what} of {', '.join(names)}" for what, names in parts.items() if names)


def forces_text(robot: Robot) -> str | None:
    """Return the text of the file; None if MJCF can express all forces of the robot."""
    joints = [joint for joint in robot.joints if joint.has_friction or not springs_are_expressible(joint)]
    if not joints:
        return None
    from vsacli.compute.tracing import Kind, trace
    from vsacli.compute.tracing.python_functions import function_text

    names = [name for joint in joints for name in _coordinates(joint)]
    program = trace(lambda rows: _forces(joints, rows), [Kind.REAL] * (2 * len(names)))
    function = function_text(program, "forces", {"positions": len(names), "velocities": len(names)})
    words = set(re.findall(r"[a-z]\w*", function))
    return _TEXT.format(
        imports=", ".join(sorted({"array", "errstate", *(word for word in words if hasattr(np, word))})),
        name=one_line(robot.name).replace('"', "'").replace("\\", "/"),
        version=__version__,
        words=forces_words(robot),
        joints=tuple(names),
        function=function,
    )


def _named_frictions(joint: Joint) -> Iterator[tuple[str, Friction]]:
    if joint.friction is not None:
        yield f"joint {joint.name}: its friction", joint.friction
    for number, motor in enumerate(joint.actuator.motors, 1):
        if motor.friction is not None:
            yield f"joint {joint.name}: the friction of motor {number}", motor.friction


def _coordinates(joint: Joint) -> list[str]:
    """Return the coordinates of a joint and of motors that move separately from it."""
    numbers = range(1, 1 + len(joint.actuator.motors))
    return list(dict.fromkeys([joint.name, *(motor_name(joint, number) for number in numbers)]))


def _forces(joints: Sequence[Joint], rows: Sequence[Any]) -> list[Any]:
    """Return rows of forces on all coordinates, from rows of their positions and velocities."""
    positions, velocities = list(rows[: len(rows) // 2]), list(rows[len(rows) // 2 :])
    forces = []
    for joint in joints:
        count = len(_coordinates(joint))
        forces += _joint_forces(joint, positions[:count], velocities[:count])
        del positions[:count], velocities[:count]
    return forces


def _joint_forces(joint: Joint, positions: Sequence[Any], velocities: Sequence[Any]) -> list[Any]:
    """Return the torques of springs minus friction on the coordinates of a joint."""
    forces = [np.zeros_like(position) for position in positions]
    if not springs_are_expressible(joint):
        elements = joint.actuator.spring_elements
        forces = (
            _mechanism_forces(joint, positions)
            if elements is None
            else _spring_element_forces(elements, positions)
        )
    frictions = [joint.friction, *(motor.friction for motor in joint.actuator.motors)]
    for number, friction in enumerate(frictions):
        law = FrictionLaws.of([friction])
        if law is not None:
            place = min(number, len(forces) - 1)  # a motor without springs moves with the joint
            forces[place] = forces[place] - law.torque(velocities[place])
    return forces


def _spring_element_forces(elements: Sequence[SpringElement], positions: Sequence[Any]) -> list[Any]:
    """Return the torques of springs on coordinates by their weights; springs that only pull may be slack."""
    forces = [np.zeros_like(position) for position in positions]
    for spring in elements:
        weights = (spring.joint, *spring.motors)
        phi = sum(weight * position for weight, position in zip(weights, positions, strict=True))
        if spring.law.pulls_only:
            phi = np.minimum(np.maximum(phi, spring.law.domain[0]), spring.law.domain[1])
        torque = spring.law.torque(phi)
        forces = [force - weight * torque for force, weight in zip(forces, weights, strict=True)]
    return forces


def _mechanism_forces(joint: Joint, positions: Sequence[Any]) -> list[Any]:
    """Return the torques of the springs of a joint from its elasticity, if they have no spring elements."""
    elasticity = type(joint.actuator).elasticity([joint.actuator])
    torques = elasticity.torques(elasticity.coordinates(positions[0], np.stack(positions[1:], axis=-1)))
    against = (torques.tau_transmission[..., side] for side in range(len(joint.actuator.motors)))
    return [torques.tau_e, *(-each for each in against)]
