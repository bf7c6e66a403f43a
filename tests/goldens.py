"""Record what a git revision of vsacli computes and prints, and compare two such records.

    python tests/goldens.py REVISION FOLDER             # record the revision
    python tests/goldens.py NEWER NEW --against OLD     # record it, then compare it with the older record
    python tests/goldens.py --compare OLD NEW           # compare two records

A revision is installed in an environment of its own and runs the cases below with the robots and
trajectories that it bundles: every bundled pair by both engines, generated C and exported models of every
robot, simulations, and 40 variants that are infeasible, singular, over a limit, recorded or damaged. Each
case is a folder that holds the files that were written and, per command, its exit code and what it printed.

Comparison says per kind of output how many are equal bit for bit and how far the others are off, relative
to the peak of each variable. It fails beyond `TOLERANCE`, where flags or exit codes differ, or where an
output is missing.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

REPOSITORY = Path(__file__).parents[1]
TOLERANCE = 1e-13  # of a variable's peak; what another order of the same operations changes stays below it
ENGINES = ("numpy", "c")
CONTROLLERS = ("feedforward", "feedback-linearization")
CREATED = re.compile(rb"created \S+T\S+")
PROVENANCE = {"created", "versions", "threads", "compiler", "command_line", "generated_by"}


class Case(NamedTuple):
    """Commands that run one after the other in a folder of their own, beside the bundled files."""

    name: str
    commands: list[list[str]]
    prepare: Callable[[Path], None] | None = None


def pairs(root: Path) -> list[tuple[str, str]]:
    """Return each bundled robot with each trajectory whose first comment names it, as paths below `root`."""
    found = []
    for trajectory in sorted((root / "trajectories").rglob("*.yaml")):
        words = trajectory.read_text().partition(": ")[0]
        robots = re.findall(r"robots/[\w/]+\.yaml", words)
        found += [(robot, str(trajectory.relative_to(root))) for robot in robots]
    return found


def cases(root: Path) -> Iterator[Case]:
    """Yield all cases for the files bundled below `root`."""
    found = pairs(root)
    for robot, trajectory in found:
        yield from (
            run(f"pair-{stem(robot)}-{stem(trajectory)}-{engine}", robot, trajectory, engine)
            for engine in ENGINES
        )
    for robot in sorted({robot for robot, _ in found}):
        yield model(robot)
    for robot, trajectory in found[:: max(1, len(found) // 6)]:
        yield simulation(robot, trajectory)
    yield from variants(found)


def run(
    name: str,
    robot: str,
    trajectory: str,
    engine: str,
    *options: str,
    prepare: Callable[[Path], None] | None = None,
) -> Case:
    """Return the case of a whole run: the report as text and as JSON, the result file, and exports of it."""
    inputs = [robot, trajectory, *options, "--engine", engine]
    commands = [
        ["invdyn", *inputs, "-o", "result.h5"],
        ["check-feasibility", *inputs, "--json"],
        ["export", "result.h5", "--allow-nan", "-o", "torques.csv"],
        [
            "export",
            "result.h5",
            "--allow-nan",
            "--format",
            "joint-trajectory",
            "--variables",
            "q,dq,tau_e",
            "-o",
            "points.yaml",
        ],
    ]
    return Case(name, commands, prepare)


def model(robot: str) -> Case:
    """Return the case of one robot's generated C, in both precisions, and its models for other programs."""
    codegen = [
        ["codegen", robot, "--precision", precision, "-o", precision] for precision in ("double", "float")
    ]
    exports = [["export", robot, "--format", form, "-o", f"robot.{form}"] for form in ("urdf", "mjcf")]
    return Case(f"model-{stem(robot)}", [*codegen, *exports, ["validate", robot], ["info", robot]])


def simulation(robot: str, trajectory: str) -> Case:
    """Return the case of one motion simulated under every controller.

    With `--engine auto` it would depend on the cache when compiled code takes over.
    """
    options = ["--rtol", "1e-8", "--engine", "c"]
    commands = [
        ["simulate", robot, trajectory, "--controller", controller, *options, "-o", f"{controller}.h5"]
        for controller in CONTROLLERS
    ]
    return Case(f"simulation-{stem(robot)}-{stem(trajectory)}", commands)


def variants(found: list[tuple[str, str]]) -> Iterator[Case]:
    """Yield 40 runs that are faster, softer, heavier, recorded or damaged, in this order."""
    declared = [pair for pair in found if "vsa_3r_" not in pair[1]]
    for number, (robot, trajectory) in enumerate(declared[::3][:12]):
        share = 0.5 if number % 2 else 0.2
        duration = re.search(r"^duration: *([\d.]+)", (REPOSITORY / trajectory).read_text(), re.MULTILINE)
        setting = f"duration={share * float(duration[1]):g}" if duration else "rate=250"
        yield run(f"variant-fast-{stem(robot)}", robot, trajectory, ENGINES[number % 2], "--set", setting)
    arm, motion = "robots/vsa_3r.yaml", "trajectories/rest_to_rest_soft.yaml"
    for number, stiffness in enumerate((800.5, 805, 815, 820, 1500, 3000)):
        setting = f"stiffness.value={stiffness}"
        yield run(f"variant-stiffness-{stiffness:g}", arm, motion, ENGINES[number % 2], "--set", setting)
    for number, mass in enumerate((0.01, 5, 20, 60)):
        setting = f"joints.*.link.mass={mass}"
        yield run(f"variant-mass-{mass:g}", arm, motion, ENGINES[number % 2], "--set", setting)
    for number, (sensor, seed) in enumerate((s, n) for s in SENSORS for n in range(2)):
        name = f"variant-recorded-{sensor}-{seed}"
        yield run(name, arm, "recorded.csv", ENGINES[number % 2], prepare=recording(sensor, seed))
    yield from (damaged(name) for name in DAMAGE)


SENSORS = ("exact", "white", "encoder", "filtered", "gaps")
DAMAGE = (
    "no-robot",
    "syntax",
    "unknown-key",
    "no-number",
    "cut-csv",
    "nan-cell",
    "cut-result",
    "flipped-result",
)


def recording(sensor: str, seed: int) -> Callable[[Path], None]:
    """Return a function that writes recorded.csv: three joints, 4 s at 250 Hz, from a sensor of this kind."""

    def write(folder: Path) -> None:
        draw = random.Random(seed)
        rows, smooth = [], [0.0] * 3
        for index in range(1001):
            t = index / 250
            exact = [
                0.3 * (j + 1) * math.sin(2 * math.pi * (0.2 + 0.15 * j) * t + 0.4 * seed) for j in range(3)
            ]
            noisy = [value + draw.gauss(0, 1e-4) for value in exact]
            smooth = (
                [old + 0.2 * (value - old) for old, value in zip(smooth, noisy, strict=True)]
                if index
                else noisy
            )
            read = {"white": noisy, "filtered": smooth, "encoder": [round(v * 2048) / 2048 for v in exact]}
            cells = [*read.get(sensor, exact), 900, 900, 900]
            if not (sensor == "gaps" and 300 <= index < 340):
                rows.append(",".join(repr(value) for value in [t, *cells]))
        header = "time,base.q,shoulder.q,elbow.q,base.stiffness,shoulder.stiffness,elbow.stiffness"
        (folder / "recorded.csv").write_text("\n".join([header, *rows]) + "\n")

    return write


def damaged(kind: str) -> Case:
    """Return a case whose input is spoiled in one way."""
    arm, motion = "robots/vsa_3r.yaml", "trajectories/rest_to_rest.yaml"
    robot = {
        "no-robot": "none.yaml",
        "syntax": "bad.yaml",
        "unknown-key": "bad.yaml",
        "no-number": "bad.yaml",
    }.get(kind, arm)
    if "result" in kind:
        commands = [["invdyn", arm, motion, "-o", "whole.h5"], ["spoil", kind]]
        commands += [
            ["validate", "result.h5"],
            ["info", "result.h5"],
            ["export", "result.h5", "-o", "out.csv"],
        ]
        return Case(f"variant-damaged-{kind}", commands)
    trajectory = "recorded.csv" if kind in {"cut-csv", "nan-cell"} else motion
    commands = [["invdyn", robot, trajectory, "-o", "result.h5"], ["validate", robot, trajectory]]
    return Case(f"variant-damaged-{kind}", commands, lambda folder: spoil(folder, kind))


def spoil(folder: Path, kind: str) -> None:
    """Write the spoiled file of a case into its folder."""
    robot = (folder / "robots/vsa_3r.yaml").read_text()
    edits = {
        "syntax": ("joints:", "joints: ["),
        "unknown-key": ("gravity:", "gravitation:"),
        "no-number": ("mass: ", "mass: x"),
    }
    if kind in edits:
        (folder / "bad.yaml").write_text(robot.replace(*edits[kind], 1))
    elif kind in {"cut-csv", "nan-cell"}:
        recording("exact", 0)(folder)
        text = (folder / "recorded.csv").read_text()
        (folder / "recorded.csv").write_text(
            text[:-40] if kind == "cut-csv" else text.replace(",900,", ",nan,", 1)
        )
    elif "result" in kind:
        data = bytearray((folder / "whole.h5").read_bytes())
        if kind == "cut-result":
            data = data[: len(data) // 2]
        else:
            data[len(data) // 3] ^= 0x10
        (folder / "result.h5").write_bytes(data)


def record(revision: str, folder: Path) -> None:
    """Install a revision and run all its cases, two at a time.

    Raises:
        SystemExit: if the folder exists.
        subprocess.CalledProcessError: if git or pip fails.
    """
    if folder.exists():
        sys.exit(f"{folder} exists: name another folder, or delete it")
    source, environment = folder / "source", folder / "environment"
    source.mkdir(parents=True)
    archive = subprocess.run(["git", "archive", revision], cwd=REPOSITORY, check=True, stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", str(source)], input=archive.stdout, check=True)
    subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True)
    subprocess.run([str(environment / "bin/pip"), "install", "--quiet", str(source)], check=True)
    command = (environment / "bin/vsacli").absolute()
    with ThreadPoolExecutor(2) as pool:
        for name in pool.map(
            lambda case: execute(case, source, folder / "cases" / case.name, command), cases(source)
        ):
            sys.stderr.write(f"{name}\n")


def execute(case: Case, source: Path, folder: Path, command: Path) -> str:
    """Run the commands of a case and keep what each printed as N-COMMAND.txt, its exit code first."""
    folder.mkdir(parents=True)
    for bundled in ("robots", "trajectories"):
        (folder / bundled).symlink_to((source / bundled).absolute())
    if case.prepare is not None:
        case.prepare(folder)
    plain = {**os.environ, "NO_COLOR": "1", "COLUMNS": "100", "OMP_NUM_THREADS": "1"}
    for number, arguments in enumerate(case.commands):
        if arguments[0] == "spoil":
            spoil(folder, arguments[1])
            continue
        done = subprocess.run(
            [str(command), *arguments], cwd=folder, capture_output=True, text=True, env=plain, check=False
        )
        text = f"exit code {done.returncode}\n{done.stdout}\n--- stderr\n{done.stderr}"
        (folder / f"{number}-{arguments[0]}.txt").write_text(text)
    return case.name


def compare(before: Path, after: Path) -> bool:
    """Print how far two records differ; return whether they agree."""
    old, new = outputs(before), outputs(after)
    missing = [f"missing: {name}" for name in sorted(old.keys() - new.keys())]
    added = [f"new: {name}" for name in sorted(new.keys() - old.keys())]
    counts: Counter[str] = Counter()
    worst: dict[str, float] = {}
    failures = []
    for name in sorted(old.keys() & new.keys()):
        kind, differences, distance = difference(old[name], new[name])
        counts[
            f"{kind}, {'different' if differences else 'equal' if not distance else 'within the tolerance'}"
        ] += 1
        worst[kind] = max(worst.get(kind, 0.0), distance)
        failures += [f"{name}: {text}" for text in differences]
    totals = [f"{count:5d} {kind}" for kind, count in sorted(counts.items())]
    distances = [
        f"largest difference, {kind}: {value:.1e} of a peak" for kind, value in worst.items() if value
    ]
    sys.stdout.write("\n".join([*missing, *added, *failures, *totals, *distances]) + "\n")
    return not (missing or failures)


def outputs(folder: Path) -> dict[str, Path]:
    """Return every file that the cases of a record wrote or printed, by its path below the cases."""
    root = folder / "cases"
    files = (path for path in root.rglob("*") if path.is_file())
    spoiled = "variant-damaged-"  # their result files are inputs
    return {
        str(path.relative_to(root)): path
        for path in files
        if not (path.suffix == ".h5" and path.parent.name.startswith(spoiled))
    }


def difference(before: Path, after: Path) -> tuple[str, list[str], float]:
    """Return an output's kind, what differs beyond the tolerance, and its largest numerical difference."""
    if before.suffix == ".h5":
        return ("HDF5", *file_difference(before, after))
    kind = "printed" if before.suffix == ".txt" else f"{before.suffix or before.name} file"
    old, new = (CREATED.sub(b"created", path.read_bytes()) for path in (before, after))
    if old == new:
        return kind, [], 0.0
    lines = zip(
        old.decode(errors="replace").splitlines(), new.decode(errors="replace").splitlines(), strict=False
    )
    changed = [(left, right) for left, right in lines if left != right]
    first = "\n    - {}\n    + {}".format(*(side[:160] for side in changed[0])) if changed else " more lines"
    return kind, [f"{len(changed)} lines differ:{first}"], 0.0


def file_difference(before: Path, after: Path) -> tuple[list[str], float]:
    """Compare all datasets and attributes of two HDF5 files, except those of time, machine and versions."""
    differences: list[str] = []
    distances = [0.0]
    with h5py.File(before) as old, h5py.File(after) as new:
        names = [set(node_names(file)) for file in (old, new)]
        differences += [f"only in one of the files: {name}" for name in sorted(names[0] ^ names[1])]
        for name in sorted(names[0] & names[1]):
            if name.startswith("@"):
                equal = np.array_equal(old.attrs[name[1:]], new.attrs[name[1:]])
                differences += (
                    [] if equal else [f"attribute {name[1:]}: {old.attrs[name[1:]]} -> {new.attrs[name[1:]]}"]
                )
            elif isinstance(old[name], h5py.Dataset):
                text, distance = array_difference(old[name][()], new[name][()])
                differences += [f"{name}: {text}"] if text else []
                distances.append(distance)
    return differences, max(distances)


def node_names(file: h5py.File) -> list[str]:
    """Return the names of a file's groups and datasets, and its attributes with @ before them."""
    found: list[str] = []
    file.visit(found.append)
    return found + [f"@{name}" for name in file.attrs if name not in PROVENANCE]


def array_difference(old: object, new: object) -> tuple[str, float]:
    """Return what differs between two datasets, and how far numbers differ relative to the peak."""
    left, right = np.asarray(old), np.asarray(new)
    if left.shape != right.shape:
        return f"has shape {right.shape} instead of {left.shape}", math.inf
    if left.dtype.kind != "f":
        return ("" if np.all(left == right) else json_difference(old, new)), 0.0
    if not np.array_equal(np.isfinite(left), np.isfinite(right)):
        return "finite at other samples", math.inf
    finite = np.isfinite(left)
    peak = float(np.max(np.abs(left[finite]), initial=0.0))
    gap = float(np.max(np.abs(left[finite] - right[finite]), initial=0.0))
    distance = gap / peak if peak else gap
    return (f"differs by {distance:.1e} of its peak" if distance > TOLERANCE else ""), distance


def json_difference(old: object, new: object) -> str:
    """Say what differs between two texts, the first keys if both are JSON, such as reports."""
    try:
        left, right = (json.loads(text) for text in (old, new))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return f"differs in {np.sum(np.asarray(old) != np.asarray(new))} of {np.size(old)} entries"
    keys = [path for path, (a, b) in leaves(left, right) if a != b and not close(a, b)]
    return f"JSON differs at {', '.join(keys[:4])}, {len(keys)} in all" if keys else ""


def leaves(left: object, right: object, path: str = "") -> Iterator[tuple[str, tuple[object, object]]]:
    """Yield each place at which two JSON values have something to compare."""
    if isinstance(left, dict) and isinstance(right, dict):
        for key in left.keys() | right.keys():
            yield from leaves(left.get(key), right.get(key), f"{path}.{key}")
    elif isinstance(left, list) and isinstance(right, list) and len(left) == len(right):
        for index, (a, b) in enumerate(zip(left, right, strict=True)):
            yield from leaves(a, b, f"{path}[{index}]")
    else:
        yield path, (left, right)


def close(left: object, right: object) -> bool:
    """Return whether two numbers of a report agree as far as another order of operations allows."""
    numbers = isinstance(left, float) and isinstance(right, float)
    return numbers and abs(left - right) <= 1e-9 * max(abs(left), abs(right)) + 1e-11  # residuals: near 1e-12


def stem(path: str) -> str:
    return Path(path).stem


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("revision", help="git revision to record; with --compare the older record")
    parser.add_argument("folder", type=Path, help="folder for the record; with --compare the newer record")
    parser.add_argument("--against", type=Path, help="older record to compare with")
    parser.add_argument("--compare", action="store_true", help="record nothing: both arguments are records")
    given = parser.parse_args()
    if given.compare:
        sys.exit(not compare(Path(given.revision), given.folder))
    record(given.revision, given.folder)
    if given.against is not None:
        sys.exit(not compare(given.against, given.folder))


if __name__ == "__main__":
    main()
