"""Every command, with the same wicked texts wherever a file, or its name, can hold one."""

from __future__ import annotations

import csv
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
import pytest
import yaml
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, Outcome
from samples.marks import COMPILERS, slow_but
from samples.wicked import PRINTABLE, TEXTS, as_yaml, clean

URDF = REPOSITORY / "robots" / "desk_arm.urdf"

ARM = yaml.safe_load(ROBOT.read_text(encoding="utf-8"))
MOVE = {**yaml.safe_load(REST_TO_REST.read_text(encoding="utf-8")), "rate": 10}
CHAIN = URDF.read_text(encoding="utf-8")

Command = Callable[..., Outcome]


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands run in; a file next to it was written to the wrong place."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def command(work: Path, vsacli: Command, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Runs a command line, of which a terminal sees nothing but letters and ends of lines."""
    monkeypatch.chdir(work)

    def run(*arguments: object, codes: tuple[int, ...] = (0,)) -> Outcome:
        done = vsacli(*arguments)
        assert done.code in codes, (arguments, done)
        assert clean(done.out + done.err), (arguments, done)
        return done

    return run


def written(path: Path, content: dict[str, Any]) -> Path:
    """A YAML file."""
    path.write_text(as_yaml(content), encoding="utf-8")
    return path


def in_urdf(word: str, text: str) -> str:
    """The URDF with a text in place of a name."""
    return CHAIN.replace(f'"{word}"', quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}))


def files_with(text: str, folder: Path) -> dict[str, Path]:
    """A file for each place where a text can stand, by the place."""
    joints = [{**joint, "name": text} for joint in ARM["joints"][:1]]
    stiffness = {"type": "constant", "value": {text: 1}}
    position = {"type": "csv", "file": text}
    files = {
        "robot": written(folder / "robot.yaml", {**ARM, "name": text}),
        "description": written(folder / "description.yaml", {**ARM, "description": text}),
        "joint": written(folder / "joint.yaml", {**ARM, "joints": joints}),
        "key": written(folder / "key.yaml", {**ARM, text: 1}),
        "value": written(folder / "value.yaml", {**ARM, "gravity": text}),
        "trajectory": written(folder / "trajectory.yaml", {**MOVE, "name": text}),
        "by joint": written(folder / "by_joint.yaml", {**MOVE, "stiffness": stiffness}),
        "referred to": written(folder / "referred.yaml", {**MOVE, "position": position}),
    }
    for word in ("desk-arm", "shoulder", "forearm"):
        files[f"URDF {word}"] = folder / f"{word}.urdf"
        files[f"URDF {word}"].write_text(in_urdf(word, text), encoding="utf-8", errors="surrogatepass")
    rows = [["time", "q1", text], *([0.1 * k, 0.01 * k**2, k] for k in range(12))]
    files["header"] = folder / "header.csv"
    with files["header"].open("w", encoding="utf-8", errors="surrogatepass", newline="") as stream:
        stream.write(f"# {text}\n")
        csv.writer(stream).writerows(rows)
    return files


@pytest.mark.cases(7)
@pytest.mark.parametrize("kind", slow_but({"markdown", "unprintable escape"}, TEXTS))
def test_a_text_in_any_place_of_a_file_is_read_or_refused(command: Command, work: Path, kind: str) -> None:
    (work / "in").mkdir()
    files = files_with(TEXTS[kind], work / "in")
    for place, path in files.items():
        for way in (("validate",), ("validate", "--json")):
            assert command(*way, path, codes=(0, 2)).out, (place, way)
        if place.startswith("URDF"):
            done = command("import-urdf", path, "--tip", "flange", "-o", f"{path.stem}.yaml", codes=(0, 2))
            assert done.code == 2 or command("validate", f"{path.stem}.yaml")
    for option in ("--field", "--robot", "--extract"):
        command("info", ROBOT, option, TEXTS[kind], codes=(0, 2))
    command("invdyn", ROBOT, REST_TO_REST, "--variables", TEXTS[kind], codes=(2,))
    command("import-urdf", URDF, "--tip", TEXTS[kind], "-o", "made.yaml", codes=(2,))
    command(TEXTS[kind], codes=(0, 2))
    command("schema", TEXTS[kind], codes=(2,))
    command("schema", "robot", TEXTS[kind], codes=(2,))
    command("validate", f"--{TEXTS[kind]}", codes=(2,))
    assert {path.name for path in work.iterdir()} <= {"in", *(f"{path.stem}.yaml" for path in files.values())}
    assert [path.name for path in work.parent.iterdir()] == ["work"]


def stem_of(text: str) -> str | None:
    """The text as the name of a file without its ending, if the system takes it."""
    stem = text.replace("/", "\N{DIVISION SLASH}")
    try:
        long = len(os.fsencode(f"{stem}-robot.yaml")) > 255
    except UnicodeEncodeError:  # a surrogate that stands for no byte
        return None
    return None if "\0" in stem or not stem or long else stem


COMMANDS: tuple[tuple[str, ...], ...] = (
    ("validate", "ROBOT", "MOVE"),
    ("info", "ROBOT"),
    ("info", "MOVE", "--robot", "ROBOT"),
    ("invdyn", "ROBOT", "MOVE", "-o", "RESULT"),
    ("invdyn", "ROBOT", "MOVE", "--variables", "flags"),
    ("check-feasibility", "ROBOT", "SOFT", "--write-fix", "1", "-o", "OUT/fixed.yaml"),
    ("validate", "ROBOT", "OUT/fixed.yaml"),
    ("simulate", "ROBOT", "MOVE", "-o", "OUT/s.h5", "--budget", "60"),
    ("codegen", "ROBOT", "-o", "OUT/code"),
    ("plot", "RESULT", "-o", "OUT/figures", "--format", "svg", "-v"),
    ("export", "RESULT", "-o", "OUT/table.csv", "--variables", "q,stiffness"),
    ("invdyn", "ROBOT", "OUT/table.csv", "-o", "OUT/again.h5"),
    ("compare", "RESULT", "OUT/table.csv"),
    ("optimize", "ROBOT", "MOVE", "-o", "OUT/best.yaml"),
    ("sensitivity", "ROBOT", "MOVE", "--parameters", "joints.base.link.mass"),
    ("size", "ROBOT", "MOVE"),
    ("info", "RESULT"),
    ("info", "RESULT", "--json"),
    ("info", "RESULT", "--extract", "OUT/inputs"),
    ("validate", "RESULT", "--recompute"),
    ("new", "trajectory", "--robot", "ROBOT", "-o", "OUT/new.yaml"),
    ("import-urdf", "CHAIN", "--tip", "flange", "-o", "OUT/chain.yaml"),
    ("import-urdf", "CHAIN", "--tip", "flange"),
    ("validate", "OUT/chain.yaml"),
    ("new", "robot", "--joints", "R", "-o", "OUT/template.yaml"),
    ("examples", "rp_2", "--copy", "OUT"),
    ("info", "--cache", "OUT"),
)
"""Each word in capitals is a file, or folder, whose name is the text, and which holds it where it may."""

ENDINGS = {"ROBOT": ".yaml", "MOVE": ".move.yaml", "SOFT": ".soft.yaml", "RESULT": ".h5", "CHAIN": ".urdf"}

CODES = {"simulate": (3,)}

TOO_LONG = 4
"""Exit code where two names of 200 letters make one that the file system does not take."""


EVERYWHERE = ("shell", "markup", "letters", "long", "unprintable escape")
"""Texts that every command gets; the others differ from these by what a file that is read may hold."""


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", EVERYWHERE)
def test_every_command_with_names_and_files_of_a_text(command: Command, work: Path, kind: str) -> None:
    text, stem = TEXTS[kind], stem_of(TEXTS[kind])
    if stem is None:
        pytest.skip("no file can have this name")
    places = {name: f"in/{stem}{ending}" for name, ending in ENDINGS.items()} | {"OUT": f"in/{stem} "}
    (work / places["OUT"]).mkdir(parents=True)
    name = text if kind in PRINTABLE else "arm"
    soft = {"type": "polynomial", "degree": 3, "start": 850, "end": 790}
    written(work / places["ROBOT"], {**ARM, "name": name, "description": name})
    written(work / places["MOVE"], {**MOVE, "name": name})
    written(work / places["SOFT"], {**MOVE, "name": name, "stiffness": soft})
    (work / places["CHAIN"]).write_text(in_urdf("forearm", name), encoding="utf-8")
    for words in COMMANDS:
        parts = (word.partition("/") for word in words)
        arguments = ["".join([places.get(first, first), slash, rest]) for first, slash, rest in parts]
        long = (TOO_LONG,) if len(stem) > 100 else ()
        command(*arguments, codes=(*CODES.get(words[0], (0,)), *long))
    assert [path.name for path in work.parent.iterdir()] == ["work"]
    assert {path.suffix for path in work.iterdir()} <= {"", ".h5", ".yaml"}
    check_contents(work / places["OUT"], work / places["RESULT"], name)


def check_contents(out: Path, result: Path, name: str) -> None:
    """What was written means to its readers what it is to mean."""
    for figure in (out / "figures").glob("*.svg"):
        ElementTree.parse(figure)
    prefix = next((out / "code").glob("*.h")).stem
    assert re.fullmatch("[a-z][a-z0-9_]*", prefix)
    for compiler in COMPILERS[:1]:
        flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
        sources = [f"{prefix}.c", f"{prefix}_test.c"]
        assert subprocess.run([compiler, *flags, *sources], cwd=out / "code", check=False).returncode == 0
    readme = (out / "code" / "README.md").read_text(encoding="utf-8")
    assert re.sub(r"\\(.)", r"\1", readme.splitlines()[0]) == f"# {name} in C"
    assert not re.search(r"(?<!\\)[`*\[<]", readme.splitlines()[0])
    with (out / "table.csv").open(encoding="utf-8", newline="") as stream:
        header, *_ = csv.reader(stream)
    assert header[1] == "base.q"
    with h5py.File(result) as first, h5py.File(out / "again.h5") as second:
        assert first.attrs["robot_name"] == name
        for variable in ("q", "stiffness"):
            np.testing.assert_array_equal(first[variable][...], second[variable][...])
