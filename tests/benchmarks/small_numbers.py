"""What link torques cost where their products are below 2.2e-308, beside those of the usual motion."""

from __future__ import annotations

from subjects import motion, seven_joints
from timing import Seconds, cpu_seconds, medians

from vsacli import link_torques
from vsacli.compute.engine import choose_engine
from vsacli.dynamics.elastic_torques import LinkTorques

SIZES = (1e-105, 1e-160, 1e-200, 1e-310)
"""Of the derivatives: their products of three, of two, and they themselves are subnormal, or were."""


def compare(samples: int, repeats: int) -> dict[str, Seconds]:
    """Of each engine, processor time with small derivatives over that of the usual ones, by their size."""
    robot = seven_joints()
    position, *derivatives = motion(7, samples)
    motions = {
        f"{size:g}": [position, *(size * derivative for derivative in derivatives)] for size in (1, *SIZES)
    }
    found = {}
    for name in ("numpy", "c"):
        engine = choose_engine(name, LinkTorques(robot), samples, threads=1).engine
        ways = {
            size: cpu_seconds(
                lambda moving=moving, engine=engine: link_torques(robot, *moving, engine=engine)
            )
            for size, moving in motions.items()
        }
        taken = medians(ways, repeats)
        usual = taken.pop("1")
        found[name] = {size: seconds / usual for size, seconds in taken.items()}
    return found
