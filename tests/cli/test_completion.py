"""Shells complete commands, options, choices and file names, and do so at once."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from vsacli.cli.main import vsacli

TOOL = f"{sys.executable} -m vsacli"
NO_FILES = ("names", "kind")
"""Arguments that are no files: names of examples, kinds of files."""


def asked(shell: str, words: str, folder: Path, **variables: str) -> list[str]:
    """What the tool answers the script that it wrote for a shell."""
    environment = {**os.environ, "_VSACLI_COMPLETE": f"{shell}_complete", "COMP_WORDS": words, **variables}
    answer = subprocess.run(
        TOOL.split(), env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    return answer.stdout.splitlines()


def in_bash(*words: str, folder: Path) -> list[str]:
    return asked("bash", " ".join(words), folder, COMP_CWORD=str(len(words) - 1))


def test_commands_are_completed_in_bash(tmp_path: Path) -> None:
    assert in_bash("vsacli", "inv", folder=tmp_path) == ["plain,invdyn"]
    assert in_bash("vsacli", "new", "ro", folder=tmp_path) == ["plain,robot"]


def test_options_and_choices_are_completed(tmp_path: Path) -> None:
    assert in_bash("vsacli", "invdyn", "--over", folder=tmp_path) == ["plain,--overwrite"]
    assert in_bash("vsacli", "invdyn", "--engine", "nu", folder=tmp_path) == ["plain,numpy"]
    assert "plain,study" in in_bash("vsacli", "schema", "st", folder=tmp_path)


def test_names_of_files_and_folders_are_left_to_the_shell(tmp_path: Path) -> None:
    assert in_bash("vsacli", "invdyn", "ro", folder=tmp_path) == ["file,ro"]
    assert in_bash("vsacli", "invdyn", "a.yaml", "b.yaml", "--plot", "fi", folder=tmp_path) == ["dir,fi"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell(shell: str, tmp_path: Path) -> None:
    environment = {**os.environ, "_VSACLI_COMPLETE": f"{shell}_source"}
    script = subprocess.run(
        TOOL.split(), env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert f"_VSACLI_COMPLETE={shell}_complete" in script
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=script, text=True, check=True)


def test_the_completion_of_bash_itself(tmp_path: Path) -> None:
    (tmp_path / "vsacli").write_text(f'#!/bin/sh\nexec {TOOL} "$@"\n')
    (tmp_path / "vsacli").chmod(0o755)
    script = """
    eval "$(_VSACLI_COMPLETE=bash_source vsacli)"
    COMP_WORDS=(vsacli check)
    COMP_CWORD=1
    _vsacli_completion vsacli
    echo "${COMPREPLY[@]}"
    """
    answer = subprocess.run(
        ["bash", "-c", script],
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.split() == ["check-feasibility"]


def test_whatever_names_a_file_or_a_folder_is_of_that_kind() -> None:
    parameters = [parameter for command in commands(vsacli) for parameter in command.params]
    texts = [each for each in parameters if each.type.name not in ("file", "folder")]
    assert {each.name for each in texts if isinstance(each, click.Argument)} == set(NO_FILES)
    assert not [each.opts for each in texts if each.metavar in ("FILE", "FOLDER")]


def commands(group: click.Group) -> Iterator[click.Command]:
    for command in group.commands.values():
        yield command
        if isinstance(command, click.Group):
            yield from commands(command)


def test_completing_imports_nothing_that_computes(tmp_path: Path) -> None:
    """So it takes a tenth of a second."""
    loaded = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "vsacli"],
        env={
            **os.environ,
            "_VSACLI_COMPLETE": "bash_complete",
            "COMP_WORDS": "vsacli invdyn --",
            "COMP_CWORD": "2",
        },
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    ).stderr
    assert "click.shell_completion" in loaded
    assert not any(f" {library}\n" in loaded for library in ("numpy", "scipy", "h5py", "yaml", "matplotlib"))
