"""Help texts of options say how to write their values; the help of `plot` reaches its options soon."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import pytest
from samples.command_line import REST_TO_REST, ROBOT

SEPARATED = {
    ("simulate", "--initial-error"): "one value for all joints, or one for each, separated by commas",
    ("simulate", "--initial-stiffness-error"): "in the form of --initial-error",
    ("codegen", "--wrench"): "in the axes of this frame: end_effector or base;",
    ("plot", "--joints"): "the joints with these names, separated by commas",
    ("plot", "--variables"): "separated by commas, e.g. theta,dtheta",
    ("export", "--variables"): "separated by commas, e.g. tau_motor,flags",
    ("identify", "--fit"): "separated by commas",
    ("new robot", "--joints"): "Types of the joints from the base to the tip, a letter for each",
    ("new robot", "--length"): "separated by commas",
    ("optimize", "-o, --output"): "which is only reported otherwise",
}
"""Words of the help text of an option, by command and option."""

MOST_LINES = 20
"""Lines before the options of a command."""


@pytest.mark.parametrize(("place", "words"), SEPARATED.items(), ids=lambda part: str(part)[:60])
def test_an_option_says_how_its_value_is_written(vsacli: Any, place: tuple[str, str], words: str) -> None:
    command, option = place
    text = vsacli(*command.split(), "--help").out.partition("\nOptions:")[2]
    of_option = re.split(r"\n  (?=-)", text.partition(f"\n  {option} ")[2])[0]
    assert words in " ".join(of_option.split())


def test_the_help_of_plot_reaches_its_options_soon(vsacli: Any) -> None:
    before = vsacli("plot", "--help").out.partition("\nOptions:")[0]
    assert len(before.splitlines()) <= MOST_LINES
    assert "docs/figures.md" in before


def size_of_png(path: Path) -> tuple[int, int]:
    """Width and height in the header of a PNG file."""
    return struct.unpack(">II", path.read_bytes()[16:24])


@pytest.mark.slow
def test_resolution_of_a_figure(vsacli: Any) -> None:
    """Pixels are in proportion to the dots per inch, 220 by default."""
    for name, options in (("usual", ()), ("coarse", ("--dpi", 55))):
        assert vsacli("plot", ROBOT, "-o", name, *options).code == 0
    for figure in Path("usual").iterdir():
        usual, coarse = (size_of_png(Path(folder) / figure.name) for folder in ("usual", "coarse"))
        assert coarse == pytest.approx([pixels / 4 for pixels in usual], abs=1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--dpi", 300, "--format", "pdf"), "--dpi is for png; pdf figures have no pixels, leave it out"),
        (("--dpi", 300, "--format", "html"), "--dpi cannot be used with a page; leave it out"),
        (("--dpi", 5), "--dpi: must be from 20 to 1200 dots per inch, not 5 dots per inch"),
        (("--dpi", "fine"), "'fine' is not a number; expected dots per inch, e.g. 300"),
    ],
)
def test_resolutions_that_are_refused(vsacli: Any, options: tuple[object, ...], message: str) -> None:
    done = vsacli("plot", ROBOT, *options)
    assert (done.code, message in done.err) == (2, True)


@pytest.mark.slow
def test_an_optimum_without_a_file_says_so(vsacli: Any) -> None:
    quick = ("--set", "rate=20")
    done = vsacli("optimize", ROBOT, REST_TO_REST, *quick)
    assert done.code == 0
    assert "the best trajectory is not written; give -o FILE to keep it\n" in done.err
    assert "not written" not in vsacli("optimize", ROBOT, REST_TO_REST, *quick, "-o", "best.yaml").err
