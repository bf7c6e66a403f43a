"""Robots, trajectories and random blocks for the tests of files; nothing here is computed by vsacli."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from samples.command_line import WITHOUT_BYTECODE
from vsacli import Antagonistic, DenavitHartenberg, Inertia, Joint, Limits, Link, Motor, Robot, laws
from vsacli.base.flags import FLAG_BITS
from vsacli.base.outputs import Outputs
from vsacli.base.signals import WRENCH
from vsacli.base.variables import OF_ANY_ROBOT, UNCERTAIN, VARIABLES, Block
from vsacli.documents.source import Source
from vsacli.results.store.writer import ResultWriter
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.profile import WrenchProfile

REPORT = {"format": "vsacli-report/2", "verdict": "ok", "samples": 0, "complete": True, "warnings": ["µ: –"]}
SOURCE = Source("robots/two.yaml", "0" * 64, "name: two\n# °\n")

PUSH = WrenchProfile(
    ConstantProfile(signal=WRENCH, span=(0.0, 1.0), value=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)), "base"
)


@dataclass(frozen=True)
class PlannedTrajectory:
    """What the writer asks of a trajectory."""

    samples: int
    name: str = "swing"
    sources: tuple[Source, ...] = ()
    wrench: WrenchProfile | None = PUSH
    uncertain: tuple[str, ...] = UNCERTAIN


def joint(name: str, kind: str, index: int = 0) -> Joint:
    side = laws.Cubic(k=400.0 + index, k_c=2000.0)
    return Joint(
        name=name,
        type=kind,
        dh=DenavitHartenberg(a=0.1 * index, alpha=0.5, d=0.2, theta=-0.3),
        link=Link(
            mass=1.5 + index, com=(0.1, 0.2, 0.3 + index), inertia=Inertia(xx=0.3, yy=0.2, zz=0.2, xy=0.01)
        ),
        damping=0.5,
        actuator=Antagonistic(
            motor=(Motor(inertia=3.2, max_torque=90.0), Motor(inertia=3.3 + index)),
            spring=(side, replace(side, k=440.0)),
        ),
        limits=Limits(position=(-1.0, 2.0)),
    )


def robot(kinds: str = "RP") -> Robot:
    """A robot with one joint a letter, named j0, j1, ..."""
    types = {"R": "revolute", "P": "prismatic"}
    joints = tuple(joint(f"j{index}", types[kind], index) for index, kind in enumerate(kinds))
    return Robot(name="two", joints=joints, sources=(SOURCE,))


STORED = {name: variable for name, variable in VARIABLES.items() if variable.requires in OF_ANY_ROBOT}
"""The variables of results of these robots, by name."""


def random_block(samples: int, joints: int, rate: float = 1000.0) -> Block:
    """Random values, laid out in memory as the pipeline does; times k/rate."""
    generator = np.random.default_rng(samples + joints)

    def values(name: str) -> np.ndarray:
        dims = VARIABLES[name].dims
        length = {"joint": joints, "motor": 2, "tool": 1, "wrench_axis": 6, "displacement_axis": 6}
        if name in FLAG_BITS:
            return generator.integers(0, 1024, (length[dims[0]], samples)).astype(np.uint32).T
        shape = (*(length[dim] for dim in dims), samples)
        return np.moveaxis(generator.standard_normal(shape), -1, 0)

    time = np.arange(samples) / rate
    return Block(time=time, **{name: values(name) for name in VARIABLES if name != "time"})


def part(block: Block, start: int, stop: int) -> Block:
    return Block(**{name: array[start:stop] for name, array in block.arrays().items()})


@contextlib.contextmanager
def writing(
    path: Path, *arguments: object, overwrite: bool = False, **options: object
) -> Iterator[ResultWriter]:
    """A writer of a file that has its name when the context is left."""
    with (
        Outputs(overwrite=overwrite) as outputs,
        ResultWriter(outputs.file(path), *arguments, **options) as writer,
    ):
        yield writer


def write_result(
    path: Path,
    block: Block,
    kinds: str = "RP",
    *,
    step: int = 100,
    planned: int | None = None,
    **options: object,
) -> Path:
    """Store a block in parts of `step` samples; `options` go to the writer."""
    samples = len(block.time)
    trajectory = PlannedTrajectory(planned or samples)
    with writing(path, robot(kinds), trajectory, **options) as writer:
        for start in range(0, samples, step):
            writer.write(part(block, start, start + step))
        writer.finish({**REPORT, "samples": samples})
    return path


def python(script: str, *arguments: str, folder: Path, **options: Any) -> subprocess.Popen[str]:
    """Start Python on a script in a folder, with this checkout and the tests importable."""
    here = Path(__file__).parents[1]
    path = os.pathsep.join([str(here.parent), str(here)])
    environment = {**os.environ, **WITHOUT_BYTECODE, "PYTHONPATH": path}
    command = [sys.executable, "-W", "error", "-c", script, *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, env=environment, **pipes, **options)


@contextlib.contextmanager
def ordinary_user() -> Iterator[None]:
    """Give up the rights of root, to whom no folder is closed."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)
