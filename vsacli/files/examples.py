"""Bundled robots and trajectories, found wherever the package is installed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from itertools import takewhile
from pathlib import Path

from vsacli.base.did_you_mean import nearest
from vsacli.base.errors import InputError, Problem
from vsacli.base.outputs import Outputs
from vsacli.robot.file import load_robot
from vsacli.robot.model import Robot
from vsacli.trajectory.file import load_trajectory


@dataclass(frozen=True)
class ExampleTrajectory:
    """A bundled trajectory.

    Attributes:
        path: path of the file.
        robots: names of the robots that it is made for.
        description: description of the motion, a clause.
    """

    path: Path
    robots: tuple[str, ...]
    description: str

    @property
    def name(self) -> str:
        """Stem of the file name."""
        return self.path.stem


@dataclass(frozen=True)
class Example:
    """A bundled robot, with the trajectories made for it."""

    path: Path
    trajectories: tuple[ExampleTrajectory, ...]

    @property
    def name(self) -> str:
        """Stem of the file name."""
        return self.path.stem

    @cached_property
    def robot(self) -> Robot:
        """Robot read from the file."""
        return load_robot(self.path)

    def files(self) -> Iterator[Path]:
        """Yield every file of the example, including tables of its springs and trajectories."""
        yield from (Path(source.path) for source in self.robot.sources)
        for trajectory in self.trajectories:
            yield from (Path(source.path) for source in load_trajectory(trajectory.path, self.robot).sources)


def examples(names: Iterable[str] = ()) -> list[Example]:
    """Return the robots with these names, by default all, in alphabetical order.

    Args:
        names: names of robots, or paths such as `robots/puma_560.yaml`.

    Raises:
        InputError: for each unknown name, with the nearest valid one.
    """
    trajectories = [_trajectory(path) for path in sorted((examples_root() / "trajectories").rglob("*.yaml"))]
    examples_by_name = {
        path.stem: Example(
            path, tuple(trajectory for trajectory in trajectories if path.stem in trajectory.robots)
        )
        for path in sorted((examples_root() / "robots").rglob("*.yaml"), key=lambda path: path.stem)
    }
    requested = {name if name in examples_by_name else Path(name).stem for name in names}
    if unknown := sorted(requested - examples_by_name.keys()):
        raise InputError(Problem("", 0, _unknown_name_message(name, examples_by_name)) for name in unknown)
    return [example for name, example in examples_by_name.items() if not requested or name in requested]


def _unknown_name_message(name: str, names: Iterable[str]) -> str:
    nearest_name = nearest(name, names)
    hint = "vsacli examples lists them" if nearest_name is None else f"did you mean {nearest_name!r}?"
    return f"no example is called {name!r}; {hint}"


def copy_examples(names: Iterable[str], folder: str | Path, outputs: Outputs) -> list[Path]:
    """Copy examples into `robots` and `trajectories` of a folder.

    Args:
        names: names of robots to copy with their trajectories and tables; without names, all bundled files
            are copied, including URDFs to import.
        folder: destination; it is created if it does not exist.
        outputs: stages the copies.

    Returns:
        Paths of the copies.

    Raises:
        InputError: as `examples`.
        StorageError: as `Outputs.file`.
    """
    requested = list(names)
    sources = (
        [path for example in examples(requested) for path in example.files()]
        if requested
        else _bundled_files()
    )
    copies = {path: Path(folder) / path.relative_to(examples_root()) for path in sources}
    for copy in copies.values():
        outputs.folder(copy.parent)
    for path, copy in copies.items():
        outputs.file(copy).write_bytes(path.read_bytes())
    return list(copies.values())


def tables_named_in(text: str) -> list[Path]:
    """Return the tables of bundled robots, such as profiles of cams, that the text of a robot file names."""
    tables = sorted((examples_root() / "robots").rglob("*.csv"))
    return [table for table in tables if table.name in text]


def opening_comment(path: Path) -> str:
    """Return the opening comment of a YAML file as one line."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), lines))


def _bundled_files() -> list[Path]:
    paths = (path for folder in ("robots", "trajectories") for path in (examples_root() / folder).rglob("*"))
    return sorted(path for path in paths if path.is_file() and not path.name.startswith("."))


def examples_root() -> Path:
    """Return the folder of `robots` and `trajectories`: in the package, or next to it in a clone."""
    package = Path(str(files("vsacli")))
    return package if (package / "robots").is_dir() else package.parent


def _trajectory(path: Path) -> ExampleTrajectory:
    """Read the opening comment of a trajectory, e.g. "For robots/a.yaml: the arm rises. More words".

    The comment names all robots before the first colon.
    """
    made_for, _, text = opening_comment(path).partition(": ")
    robots = tuple(re.findall(r"robots/(?:\w+/)*(\w+)\.yaml", made_for))
    return ExampleTrajectory(path, robots, text.partition(". ")[0].removesuffix("."))
