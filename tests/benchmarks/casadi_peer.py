"""Peer 1: what a CasADi user would do.

The rigid recursion (Luh, Walker and Paul, 1980) on `casadi.SX`, differentiated twice along the motion with
`jtimes`, as generated C code that is compiled with `gcc -O3 -march=native` and called in a C loop. It is
written apart from vsacli's recursion, which it judges: rotation matrices, and no jerk or snap.
"""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import casadi
import numpy as np

from vsacli import Joint, Robot

ORDERS = 5
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")

LOOP = """
#include <time.h>
double link_torques_of_rows(const double *rows, double *torques, long samples) {
  struct timespec begin, end;
  casadi_real work[%(work)d];
  casadi_int integers[%(integers)d];
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
  for (long k = 0; k < samples; ++k) {
    const casadi_real *argument[%(arguments)d] = {rows + k * %(inputs)d};
    casadi_real *result[%(results)d] = {torques + k * %(outputs)d};
    link_torques(argument, result, integers, work, 0);
  }
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
  return (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
}
"""


class CasadiPeer:
    """Compiled link torques of a robot; `__call__` times a loop over all samples, in processor time."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        function = function_of(robot)
        source, library = folder / "peer.c", folder / "peer.so"
        generator = casadi.CodeGenerator(source.name)
        generator.add(function)
        generator.generate(f"{folder}/")
        sizes = {
            "inputs": ORDERS * len(robot.joints),
            "outputs": 3 * len(robot.joints),
            "arguments": function.sz_arg(),
            "results": function.sz_res(),
            "work": max(1, function.sz_w()),
            "integers": max(1, function.sz_iw()),
        }
        source.write_text(source.read_text() + LOOP % sizes)
        subprocess.run(["gcc", *FLAGS, source, "-o", library, "-lm"], check=True)
        self._run = ctypes.CDLL(str(library)).link_torques_of_rows
        self._run.restype = ctypes.c_double
        self._joints = len(robot.joints)
        self.operations = function.n_instructions()

    def __call__(self, motion: list[np.ndarray]) -> tuple[float, np.ndarray]:
        """Processor seconds in the C loop, and the torques with two derivatives, (samples, 3 joints)."""
        rows = np.ascontiguousarray(np.concatenate(motion, axis=1))
        torques = np.empty((len(rows), 3 * self._joints))
        pointers = [array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in (rows, torques)]
        seconds = self._run(*pointers, ctypes.c_long(len(rows)))
        return seconds, torques


def function_of(robot: Robot, *arguments: casadi.SX) -> casadi.Function:
    """The torques of the links with two derivatives as a function of the rows of the motion.

    Further arguments are symbols in the robot.
    """
    joints = len(robot.joints)
    rows = casadi.SX.sym("rows", ORDERS * joints)
    derivatives = casadi.vertsplit(rows, joints)
    tau = _torques(robot, *derivatives[:3])
    state, rates = casadi.vertcat(*derivatives[:4]), casadi.vertcat(*derivatives[1:])
    dtau = casadi.jtimes(tau, state, rates)
    ddtau = casadi.jtimes(dtau, state, rates)
    return casadi.Function("link_torques", [rows, *arguments], [casadi.vertcat(tau, dtau, ddtau)])


def _torques(robot: Robot, q: casadi.SX, dq: casadi.SX, ddq: casadi.SX) -> casadi.SX:
    """Torques (forces) of all joints by the outward and inward recursion, in the frames of the links."""
    gravity = _pose_rotation(robot.base.rpy).T @ casadi.DM(robot.gravity)
    omega, alpha, acceleration = casadi.SX.zeros(3), casadi.SX.zeros(3), -gravity
    bodies = []
    z = casadi.DM([0, 0, 1])
    for k, joint in enumerate(robot.joints):
        rotation, offset = _row(joint, q[k])
        turned = rotation.T
        axis = turned @ z
        if joint.is_revolute:
            alpha = turned @ (alpha + z * ddq[k] + casadi.cross(omega, z * dq[k]))
            omega = turned @ (omega + z * dq[k])
            slide = casadi.SX.zeros(3)
        else:
            alpha, omega = turned @ alpha, turned @ omega
            slide = axis * ddq[k] + 2 * casadi.cross(omega, axis) * dq[k]
        acceleration = turned @ acceleration + _point(omega, alpha, offset) + slide
        com = casadi.DM(joint.link.com)
        tensor = casadi.DM(joint.link.inertia.tensor)
        force = joint.link.mass * (acceleration + _point(omega, alpha, com))
        moment = tensor @ alpha + casadi.cross(omega, tensor @ omega)
        bodies.append((rotation, offset, axis, com, force, moment))

    torques = []
    f, n = casadi.SX.zeros(3), casadi.SX.zeros(3)
    for k in reversed(range(len(bodies))):
        rotation, offset, axis, com, force, moment = bodies[k]
        f = f + force
        n = n + moment + casadi.cross(com, force) + casadi.cross(offset, f)
        along = n if robot.joints[k].is_revolute else f
        torques.append(casadi.dot(along, axis) + robot.joints[k].damping * dq[k])
        f, n = rotation @ f, rotation @ n
    return casadi.vertcat(*reversed(torques))


def _row(joint: Joint, q: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
    """Rotation of frame k to k-1, and origin k seen from origin k-1, in frame k."""
    dh = joint.dh
    theta, d = (q + dh.theta, dh.d) if joint.is_revolute else (dh.theta, q + dh.d)
    ct, st = casadi.cos(theta), casadi.sin(theta)
    ca, sa = (round(f(dh.alpha), 15) for f in (np.cos, np.sin))
    rotation = casadi.vertcat(
        casadi.horzcat(ct, -st * ca, st * sa),
        casadi.horzcat(st, ct * ca, -ct * sa),
        casadi.horzcat(0, sa, ca),
    )
    return rotation, casadi.vertcat(dh.a, d * sa, d * ca)


def _point(omega: casadi.SX, alpha: casadi.SX, r: casadi.SX) -> casadi.SX:
    """Acceleration of a point fixed at r, against the origin of its frame."""
    return casadi.cross(alpha, r) + casadi.cross(omega, casadi.cross(omega, r))


def _pose_rotation(rpy: tuple[float, float, float]) -> casadi.DM:
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return casadi.DM(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
