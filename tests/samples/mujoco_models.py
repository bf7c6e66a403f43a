"""Exported models in MuJoCo: its inverse dynamics, and motions that computed torques drive."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy import optimize

from vsacli import Robot, Trajectory
from vsacli.base.signals import DAMPING
from vsacli.base.variables import VARIABLES
from vsacli.base.wrench import WrenchFrame, frames_by_tool
from vsacli.robot.models.exported_model import exported_tool_names
from vsacli.robot.models.mjcf import mjcf_model
from vsacli.robot.models.mjcf_drives import Start, motor_name

mujoco = pytest.importorskip("mujoco")


class Compiled(NamedTuple):
    """A model with its data, and the forces that go beside it, which act within `compiled`."""

    model: Any
    data: Any


@contextlib.contextmanager
def compiled(robot: Robot, start: Start | None = None) -> Iterator[Compiled]:
    """The exported model, of which MuJoCo must not warn: it takes controls that are not finite for zero."""
    exported = mjcf_model(robot, start)
    model = mujoco.MjModel.from_xml_string(exported.text)
    try:
        if exported.forces is not None:
            namespace: dict[str, Any] = {}
            exec(compile(exported.forces, "forces.py", "exec"), namespace)
            namespace["install"](model)
        data = mujoco.MjData(model)
        yield Compiled(model, data)
        assert not data.warning.number.any()
    finally:
        mujoco.set_mjcb_passive(None)
        mujoco.set_mjcb_control(None)


class Coordinates(NamedTuple):
    """Positions, velocities, accelerations of the model's coordinates along a run, each (samples, nq)."""

    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray


def coordinates(robot: Robot, model: Any, result: Any) -> Coordinates:
    """Of joints and motors with springs, where MuJoCo has them."""
    samples = len(result.time)
    rows = Coordinates(*np.zeros((3, samples, model.nq)))
    names = (("q", "theta"), ("dq", "dtheta"), ("ddq", "ddtheta"))
    for index, joint in enumerate(robot.joints):
        for values, (of_joint, of_motor) in zip(rows, names, strict=True):
            values[:, model.joint(joint.name).qposadr[0]] = getattr(result, of_joint)[:, index]
            for side in range(joint.actuator.motor_count if joint.actuator.sprung else 0):
                place = model.joint(motor_name(joint, side + 1)).qposadr[0]
                values[:, place] = getattr(result, of_motor)[:, index, side]
    return rows


def torques(robot: Robot, result: Any) -> np.ndarray:
    """(samples, motors) in the order of exported columns."""
    columns = [
        result.tau_motor[:, index, side]
        for index, joint in enumerate(robot.joints)
        for side in range(joint.actuator.motor_count)
    ]
    return np.stack(columns, axis=1)


def controls(robot: Robot, result: Any) -> np.ndarray:
    """Torques of the motors, then the damping of each damper."""
    columns = list(torques(robot, result).T)
    for index, joint in enumerate(robot.joints):
        if joint.damper is not None:
            columns += [getattr(result, DAMPING.key)[:, index]] * _dampers(joint)
    return np.stack(columns, axis=1)


def forces_of_tools(
    robot: Robot, frame: WrenchFrame, wrench: np.ndarray, model: Any, data: Any
) -> np.ndarray:
    """Forces on MuJoCo's coordinates of the wrenches on the tools, six components each, in their frames."""
    total = np.zeros(model.nv)
    for name, of_tool, components in zip(
        exported_tool_names(robot), frames_by_tool(frame), wrench.reshape(-1, 6), strict=True
    ):
        if of_tool is not None:
            site, body = data.site(name), model.site(name).bodyid[0]
            axes = site.xmat.reshape(3, 3) if of_tool == "end_effector" else np.eye(3)
            force, moment = axes @ components[:3], axes @ components[3:]
            mujoco.mj_applyFT(model, data, force, moment, site.xpos, body, total)
    return total


def frame_of_wrenches(trajectory: Trajectory) -> WrenchFrame:
    """Frame of the wrenches of a trajectory on the tools; empty without any."""
    return () if trajectory.wrench is None else trajectory.wrench.frame


def inverse_error(robot: Robot, result: Any, frame: WrenchFrame = ()) -> float:
    """Largest error of the forces that MuJoCo finds for a run, a share of the peak of all torques.

    With wrenches on the tools, if their frame is given.
    """
    with compiled(robot) as (model, data):
        rows, commands = coordinates(robot, model, result), controls(robot, result)
        errors = []
        for sample in range(len(result.time)):
            data.qpos[:], data.qvel[:], data.qacc[:] = (values[sample] for values in rows)
            data.ctrl[:] = commands[sample]
            mujoco.mj_inverse(model, data)
            mujoco.mj_fwdActuation(model, data)
            exerted = data.qfrc_actuator.copy()
            if frame:
                exerted += forces_of_tools(robot, frame, result.wrench[sample], model, data)
            errors.append(np.abs(data.qfrc_inverse - exerted).max())
    return float(np.max(errors) / np.abs(result.tau_motor[np.isfinite(result.tau_motor)]).max())


def driven(robot: Robot, result: Any, frame: WrenchFrame = ()) -> np.ndarray:
    """Positions of MuJoCo's coordinates less those of a run, (steps, nq).

    A step of RK4 goes over two samples, so that the torques of all its stages are known, and the wrenches on
    the tools, if their frame is given.
    """
    with compiled(robot) as (model, data):
        rows, commands = coordinates(robot, model, result), controls(robot, result)
        begin, half = result.time[0], result.time[1] - result.time[0]
        model.opt.timestep = 2 * half
        data.qpos[:], data.qvel[:] = rows.positions[0], rows.velocities[0]

        def control(model: Any, data: Any) -> None:
            sample = round(data.time / half)
            data.ctrl[:] = commands[sample]
            if frame:
                data.qfrc_applied[:] = forces_of_tools(robot, frame, result.wrench[sample], model, data)

        mujoco.set_mjcb_control(control)
        errors = []
        for sample in range(2, len(result.time), 2):
            mujoco.mj_step(model, data)
            errors.append(data.qpos - rows.positions[sample])
        assert abs(begin + data.time - result.time[sample]) < half / 2
    return np.array(errors)


def accelerations(
    robot: Robot, state: Any, torque: np.ndarray, damping: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Of joints and of motors that move by themselves, NaN where there is none, at states (samples, ...)."""
    found_q, found_theta = np.full(state.q.shape, np.nan), np.full(state.theta.shape, np.nan)
    places = [
        (index, side, motor_name(joint, side + 1))
        for index, joint in enumerate(robot.joints)
        for side in range(joint.actuator.motor_count)
    ]
    with compiled(robot) as (model, data):
        for sample in range(len(state.q)):
            for index, joint in enumerate(robot.joints):
                data.joint(joint.name).qpos[0] = state.q[sample, index]
                data.joint(joint.name).qvel[0] = state.dq[sample, index]
            commands = [torque[sample, index, side] for index, side, _ in places]
            for index, side, name in places:
                if name != robot.joints[index].name:
                    data.joint(name).qpos[0] = state.theta[sample, index, side]
                    data.joint(name).qvel[0] = state.dtheta[sample, index, side]
            if damping is not None:
                commands += [
                    value
                    for joint, value in zip(robot.joints, damping[sample], strict=True)
                    for _ in range(_dampers(joint))
                ]
            data.ctrl[:] = commands
            mujoco.mj_forward(model, data)
            found_q[sample] = [data.joint(joint.name).qacc[0] for joint in robot.joints]
            for index, side, name in places:
                if name != robot.joints[index].name:
                    found_theta[sample, index, side] = data.joint(name).qacc[0]
    return found_q, found_theta


def _dampers(joint: Any) -> int:
    """Controls of a joint's damper: one beside each spring."""
    if joint.damper_at("transmission"):
        return sum(joint.actuator.has_columns(VARIABLES["phi"]))
    return int(joint.damper is not None)


def settled_compliance(
    robot: Robot, result: Any, wrench: np.ndarray, step: float, tool: int = 0
) -> np.ndarray:
    """Displacement and rotation of a tool per wrench in base axes, (6, 6), motors held as in sample 0.

    Half the difference of two equilibria with a further wrench of this step, N and N m, on the tool; the
    wrench is that on all tools, (tools, 6).
    """
    with compiled(robot) as (model, data):
        held = coordinates(robot, model, result).positions[0]
        sprung = [joint.name for joint in robot.joints if joint.actuator.sprung]
        places = [model.joint(name).qposadr[0] for name in sprung]
        dofs = [model.joint(name).dofadr[0] for name in sprung]
        sites = [model.site(name) for name in exported_tool_names(robot)]
        site = sites[tool]

        def torques_at(positions: np.ndarray, load: np.ndarray) -> np.ndarray:
            data.qpos[:], data.qvel[:] = held, 0
            data.qpos[places] = positions
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            data.qfrc_applied[:] = 0
            for each, (force, moment) in zip(sites, load.reshape(-1, 2, 3), strict=True):
                place, body = data.site_xpos[each.id], int(each.bodyid[0])
                mujoco.mj_applyFT(model, data, force, moment, place, body, data.qfrc_applied)
            mujoco.mj_forward(model, data)
            return np.array(data.qfrc_smooth[dofs])

        poses = []
        further = np.eye(6 * len(sites))[6 * tool : 6 * tool + 6]
        for load in (wrench.ravel() + sign * step * unit for unit in further for sign in (1, -1)):
            solution = optimize.root(torques_at, held[places], args=(load,), tol=1e-13)
            assert np.abs(torques_at(solution.x, load)).max() < 1e-6 * step
            poses.append((data.site_xpos[site.id].copy(), data.site_xmat[site.id].reshape(3, 3).copy()))
    columns = []
    for (ahead, turned), (behind, turned_back) in zip(poses[::2], poses[1::2], strict=True):
        spin = (turned - turned_back) @ ((turned + turned_back) / 2).T
        rotation = [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
        columns.append([*(ahead - behind), *np.array(rotation) / 2])
    return np.array(columns).T / (2 * step)
