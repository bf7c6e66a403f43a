"""The fixes on a page: those that `check-feasibility --fixes` lists, or a note why nothing."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path
from typing import Any

import h5py
import pytest
from samples.command_line import REPOSITORY, ROBOT, contents
from samples.pages import Page
from samples.wicked import TEXTS, clean

from vsacli import __version__

HEADING = "Fixes"


def page_of(vsacli: Any, *files: Path) -> tuple[Page, str]:
    """The page of files, and what was said on standard error beside where it is."""
    done = vsacli("plot", *files, "--format", "html", "--overwrite")
    assert done.code == 0, done.err
    *notes, wrote = done.err.splitlines()
    return Page(Path(wrote.removeprefix("wrote "))), "\n".join(notes)


def section(page: Page, heading: str = HEADING) -> list[str]:
    """The lines below a heading, the last one the command."""
    lines = [line for line in page.text.partition(f"{heading}\n")[2].splitlines() if line]
    end = next(number for number, line in enumerate(lines) if line.startswith("vsacli "))
    return lines[: end + 1]


@pytest.fixture
def soft(vsacli: Any, too_soft: Path) -> Path:
    """An infeasible result."""
    assert vsacli("invdyn", ROBOT, too_soft, "-o", "soft.h5", "-q").code == 3
    return too_soft.with_suffix(".h5")


@pytest.mark.slow
def test_the_fixes_are_those_of_check_feasibility(vsacli: Any, soft: Path, too_soft: Path) -> None:
    """And the command that stands below them writes the first."""
    page, notes = page_of(vsacli, soft)
    *lines, announced, command = section(page)
    program, *arguments = shlex.split(command)
    done = vsacli(*arguments)
    assert "\n".join(lines) + "\n" == done.out
    assert (notes, program, announced) == (
        "",
        "vsacli",
        "this writes the trajectory with the first fix; --write-fix takes the number of any:",
    )
    assert {"fixed.yaml", "fixed.csv"} < contents(too_soft.parent).keys()


@pytest.mark.slow
def test_each_file_has_its_own_and_one_that_is_fine_has_none(
    vsacli: Any, soft: Path, feasible_result: Path
) -> None:
    page, notes = page_of(vsacli, feasible_result, soft)
    assert page.text.count(HEADING) == 1
    assert page.text.index("Report: rest-to-rest (soft)") < page.text.index(HEADING)
    assert any(
        line.startswith("1. reshape the stiffness of base")
        for line in section(page, f"{HEADING}: rest-to-rest (soft)")
    )
    assert notes == ""


@pytest.mark.slow
def test_changed_inputs_are_searched_as_they_were_changed(vsacli: Any, motion: Path) -> None:
    change = "stiffness.end=[790, 1000, 1000]"
    assert vsacli("invdyn", ROBOT, motion, "--set", change, "-o", "r.h5", "-q").code == 3
    *lines, announced, command = section(page_of(vsacli, Path("r.h5"))[0])
    done = vsacli(*shlex.split(command)[1:])
    assert done.out.endswith("\n" + "\n".join(lines) + "\n")
    assert announced.startswith("this lists them again")


def _without_input(file: h5py.File) -> None:
    del file["inputs/file_2/text"]


def _unreadable(file: h5py.File) -> None:
    file["inputs/file_2/text"][()] = "format: vsacli-trajectory/7\n"


def _older(file: h5py.File) -> None:
    file.attrs["generated_by"] = "vsacli 0.0.1"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_without_input, "does not hold {soft}, so it cannot be repeated"),
        (_unreadable, "{soft}:1: "),
        (
            _older,
            f"was computed by vsacli 0.0.1, and this is vsacli {__version__};"
            " check-feasibility --fixes looks for them",
        ),
    ],
)
def test_without_its_inputs_a_note_says_why_there_are_none(
    vsacli: Any, soft: Path, too_soft: Path, change: Any, reason: str
) -> None:
    with h5py.File(soft, "r+") as file:
        change(file)
    page, note = page_of(vsacli, soft)
    assert HEADING not in page.text
    assert note.startswith(f"{soft}: no fixes on its page: {reason.format(soft=too_soft)}")


@pytest.mark.slow
def test_no_path_of_an_input_acts(vsacli: Any, soft: Path) -> None:
    """On the page, nor as an option of the command that it shows."""
    page, _ = page_of(vsacli, soft)
    shutil.copy(soft, "wicked.h5")
    path = f"--overwrite {TEXTS['markup']}</pre><script>alert(1)</script> $(touch pwned)"
    with h5py.File("wicked.h5", "r+") as file:
        file["inputs/file_1"].attrs["path"] = path
        file["inputs/file_2"].attrs["path"] = "\u202eb"
    wicked, _ = page_of(vsacli, Path("wicked.h5"))
    assert wicked.tags == page.tags
    assert wicked.scripts == page.scripts
    assert clean(wicked.text)
    assert shlex.split(section(wicked)[-1])[2:4] == [f"./{path}", "\\u202eb"]


@pytest.mark.slow
def test_a_motion_over_a_limit_has_some_and_its_simulation_none(vsacli: Any, motion: Path) -> None:
    changes = ("--set", "joints.base.limits.velocity=0.1")
    assert "OVER LIMIT" in vsacli("invdyn", ROBOT, motion, *changes, "-o", "over.h5").out
    assert len(section(page_of(vsacli, Path("over.h5"))[0])) > 2
    scara = [REPOSITORY / folder / "scara_4.yaml" for folder in ("robots", "trajectories")]
    vsacli("simulate", *scara, "--set", "duration=0.2", "-o", "simulated.h5", "-q")
    assert HEADING not in page_of(vsacli, Path("simulated.h5"))[0].text
