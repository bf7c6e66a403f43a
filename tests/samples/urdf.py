"""URDF texts for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from samples.robots import random_inertia

TYPES = {"R": "revolute", "C": "continuous", "P": "prismatic", "F": "fixed"}
INERTIAL = (
    '<inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>'
    '<inertia ixx="0.03" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>'
)


def link(name: str, inertial: str = INERTIAL) -> str:
    return f'<link name="{name}">{inertial}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    letter: str = "R",
    *,
    xyz: str = "0 0 0.3",
    rpy: str = "0 0 0",
    rest: str = "",
) -> str:
    axis = "" if "<axis" in rest else '<axis xyz="0 0 1"/>'
    return (
        f'<joint name="{name}" type="{TYPES.get(letter, letter)}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>{axis}{rest}</joint>'
    )


def robot(*elements: str) -> str:
    """A URDF with one element a line, the first on line 2."""
    return "\n".join(['<robot name="sample">', *elements, "</robot>"])


def serial(letters: str, rpys: list[str] | None = None, xyz: str = "0.3 0 0.1") -> str:
    """A chain of joints j1, j2, ... between links l0, l1, ..., each turned by its rpy."""
    rpys = rpys or ["0 0 0"] * len(letters)
    links = [link(f"l{number}") for number in range(len(letters) + 1)]
    joints = [
        joint(f"j{number}", f"l{number - 1}", f"l{number}", letter, xyz=xyz, rpy=rpy)
        for number, (letter, rpy) in enumerate(zip(letters, rpys, strict=True), start=1)
    ]
    return robot(*links, *joints)


def random_serial(letters: str, seed: int) -> str:
    """A chain of random geometry, axes and inertias; among its placements, right angles and none at all."""
    return random_tree(letters, range(len(letters)), seed)


def random_tree(letters: str, parents: Sequence[int], seed: int) -> str:
    """Joints j1, j2, ... like those of `random_serial`, each between the link of its parent and its own."""
    rng = np.random.default_rng(seed)
    links = [link(f"l{number}", _random_inertial(rng)) for number in range(len(letters) + 1)]
    joints = [
        joint(
            f"j{number}",
            f"l{parent}",
            f"l{number}",
            letter,
            xyz=_words(rng.uniform(-0.5, 0.5, 3) * rng.integers(0, 2, 3)),
            rpy=_words(_random_angles(rng)),
            rest=f'<axis xyz="{_words(_random_axis(rng))}"/>',
        )
        for number, (letter, parent) in enumerate(zip(letters, parents, strict=True), start=1)
    ]
    return robot(*links, *joints)


def _random_inertial(rng: np.random.Generator) -> str:
    inertia = random_inertia(rng)
    moments = " ".join(f'i{name}="{value!r}"' for name, value in vars(inertia).items())
    origin = f'<origin xyz="{_words(rng.uniform(-0.3, 0.3, 3))}" rpy="{_words(rng.uniform(-3, 3, 3))}"/>'
    return f'<inertial>{origin}<mass value="{rng.uniform(0.5, 8)!r}"/><inertia {moments}/></inertial>'


def _random_angles(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-3, 3, 3) if rng.random() < 0.5 else rng.integers(-2, 3, 3) * (np.pi / 2)


def _random_axis(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1, 1, 3) if rng.random() < 0.4 else np.roll([0.0, 0.0, 1.0], rng.integers(3))


def _words(numbers: np.ndarray) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
