"""Files that the tests of the command line give it, and ways to run it."""

from __future__ import annotations

import os
import resource
import subprocess
import sysconfig
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[2]
ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"
SEVEN_JOINTS = REPOSITORY / "robots" / "lwr_7r_vsa.yaml"
REST_TO_REST = REPOSITORY / "trajectories" / "rest_to_rest.yaml"
SEVEN_JOINTS_MOTION = REPOSITORY / "trajectories" / "lwr_7r.yaml"

COMMAND = Path(sysconfig.get_path("scripts")) / "vsacli"
"""The installed command."""


WITHOUT_BYTECODE = {"PYTHONDONTWRITEBYTECODE": "1"}
"""For processes with a limit on the size of files, in which Python stores bytecode that ends too early."""


@dataclass(frozen=True)
class Outcome:
    """Exit code of a command line, and what it printed."""

    code: int
    out: str
    err: str


def without_hint(printed: str) -> str:
    """A printed report without the line that says how to list fixes."""
    return "".join(line for line in printed.splitlines(True) if not line.startswith("to list fixes"))


def edited(source: Path, target: Path, *changes: tuple[str, str]) -> Path:
    """A copy of a file with texts replaced, each of which must stand in it."""
    content = source.read_text()
    for old, new in changes:
        assert old in content, f"{source} has no {old!r}"
        content = content.replace(old, new)
    target.write_text(content)
    return target


def rest_to_rest(target: Path, end_stiffness: float = 1275) -> Path:
    """The shipped 3R motion at 100 samples a second, 401 steps, ending at a stiffness."""
    return edited(REST_TO_REST, target, ("rate: 1000 ", "rate: 100 "), ("end: 1275", f"end: {end_stiffness}"))


def seven_joint_motion(target: Path, rate: float) -> Path:
    """The shipped motion of the 7R arm, which takes 3 s, at another rate."""
    return edited(SEVEN_JOINTS_MOTION, target, ("rate: 1000 ", f"rate: {rate} "))


def installed(
    *arguments: object, folder: Path, largest_file: int | None = None, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run the installed command in a folder and wait for it; no file grows beyond `largest_file` bytes."""
    command = [str(COMMAND), *map(str, arguments)]
    if largest_file is not None:
        limits = largest_file, largest_file
        options["preexec_fn"] = partial(resource.setrlimit, resource.RLIMIT_FSIZE, limits)
        options["env"] = {**options.get("env", os.environ), **WITHOUT_BYTECODE}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.run(command, cwd=folder, check=False, **{**pipes, **options})


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, hidden ones too, with its bytes."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
