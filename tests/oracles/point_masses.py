"""Bodies made of point masses, and the torques of a chain from the elementary mechanics of each point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oracles.lagrange import Chain, Derivatives
from vsacli.base.arrays import FloatArray


@dataclass(frozen=True)
class Cloud:
    """Masses (points,) at fixed positions (points, 3) in a link frame."""

    masses: FloatArray
    points: FloatArray

    @property
    def mass(self) -> float:
        """Total mass."""
        return float(self.masses.sum())

    @property
    def com(self) -> FloatArray:
        """Center of mass."""
        return self.masses @ self.points / self.mass

    @property
    def inertia(self) -> dict[str, float]:
        """Central tensor in the notation of URDF, entry by entry as integrals over the body."""
        x, y, z = (self.points - self.com).T
        integral = self.masses.dot
        return {
            "xx": integral(y**2 + z**2),
            "yy": integral(x**2 + z**2),
            "zz": integral(x**2 + y**2),
            "xy": -integral(x * y),
            "xz": -integral(x * z),
            "yz": -integral(y * z),
        }


def random_cloud(rng: np.random.Generator, points: int) -> Cloud:
    """Points without symmetry."""
    return Cloud(rng.uniform(0.1, 1, points), rng.uniform((-0.5, -0.2, 0.0), (0.1, 0.3, 0.6), (points, 3)))


def torques(chain: Chain, clouds: Sequence[Cloud]) -> FloatArray:
    """Torques (samples, joints) that drive the clouds, without damping; of the chain only the motion is used.

    Each point needs the force m (r'' - g). Its share of a joint's torque is the moment of that force about
    the axis, or for a prismatic joint the component along it.
    """
    base = np.broadcast_to(np.eye(4), chain.poses[0][0].shape)
    frames = [base, *(pose[0] for pose in chain.poses[:-1])]
    columns = [
        sum(
            _torque(frame, link.revolute, pose, cloud, chain.gravity[:3])
            for pose, cloud in zip(chain.poses[i:], clouds[i:], strict=True)
        )
        for i, (frame, link) in enumerate(zip(frames, chain.links, strict=True))
    ]
    return np.column_stack(columns)


def _torque(
    frame: FloatArray, revolute: bool, pose: Derivatives, cloud: Cloud, gravity: FloatArray
) -> FloatArray:
    axis, origin = frame[:, None, :3, 2], frame[:, None, :3, 3]
    forces = cloud.masses[:, None] * (_moved(pose[2], cloud.points) - gravity)
    arms = _moved(pose[0], cloud.points) - origin
    vectors = np.cross(arms, forces) if revolute else forces
    return np.sum(vectors * axis, axis=(1, 2))


def _moved(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Positions (samples, points, 3) in the base frame, or their derivative if `pose` is that of the pose."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    moved: FloatArray = pose[:, None] @ homogeneous[:, :, None]
    return moved[..., :3, 0]
