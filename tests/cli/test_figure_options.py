"""Where figures are written, and how they look, by the options of every command that draws."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli.cli.main import vsacli as group

CM = 2.54
DOTS = 220
"""Resolution of a PNG figure, dpi."""

DRAWING = (
    *("plot", "invdyn", "simulate", "check-feasibility", "optimize"),
    *("size", "sensitivity", "compare", "identify"),
)


def size(path: Path) -> tuple[float, float]:
    """Width and height of a PNG image, cm."""
    width, height = struct.unpack(">II", path.read_bytes()[16:24])
    return width / DOTS * CM, height / DOTS * CM


@pytest.mark.parametrize("name", DRAWING)
def test_every_command_that_draws_has_the_options_of_the_look(vsacli, name):
    printed = vsacli(name, "--help").out
    for option in ("--style", "--width", "--height", "--font-size", "--no-title", "--format"):
        assert option in printed


@pytest.mark.slow
def test_the_ending_of_a_name_is_the_format(vsacli, feasible_result):
    assert vsacli("plot", feasible_result, "-o", "figures/run.svg").code == 0
    assert {path.suffix for path in Path("figures").iterdir()} == {".svg"}
    assert Path("figures/run-motion.svg").is_file()


@pytest.mark.slow
def test_a_single_figure_has_just_the_name(vsacli, feasible_result):
    assert vsacli("plot", feasible_result, "--variables", "tau_motor", "-o", "torque.pdf").code == 0
    assert [path.name for path in Path().iterdir()] == ["torque.pdf"]


@pytest.mark.slow
def test_a_run_draws_in_any_format(vsacli):
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "--set", "rate=50", "--plot", "run.pdf").code == 0
    assert Path("run-motor-torque.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
def test_paper_is_a_column_and_a_slide_is_16_to_9(vsacli, feasible_result):
    for style in ("paper", "slide"):
        ran = vsacli("plot", feasible_result, "--variables", "q", "--style", style, "-o", f"{style}.png")
        assert ran.code == 0
    assert size(Path("paper.png"))[0] == pytest.approx(8.9, abs=0.02)
    width, height = size(Path("slide.png"))
    assert width / height == pytest.approx(16 / 9, abs=0.01)


def test_width_and_height_are_those_given(vsacli, feasible_result):
    ran = vsacli("plot", feasible_result, "--variables", "q", "--width", 12, "--height", 7, "-o", "q.png")
    assert ran.code == 0
    assert size(Path("q.png")) == pytest.approx((12, 7), abs=0.02)


def test_a_title_can_be_left_out(vsacli, feasible_result):
    for options in ([], ["--no-title"]):
        name = f"q{len(options)}.svg"
        assert vsacli("plot", feasible_result, "--variables", "q", "-o", name, *options).code == 0
    assert Path("q1.svg").stat().st_size < Path("q0.svg").stat().st_size  # letters are outlines


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "q.svg", "--format", "png"], "--format png contradicts the ending of q.svg; leave one out"),
        (["-o", "q.txt"], "'q.txt': expected a folder, or the name of a figure"),
        (["-o", "f", "--width", "900"], "--width: must be from 2 to 200 cm, not 900 cm"),
        (["-o", "f", "--font-size", "1"], "--font-size: must be from 4 to 72 pt, not 1 pt"),
        (["-o", "f", "--width", "wide"], "expected a length in cm, e.g. 8.9"),
        (["-o", "p.html", "--style", "slide"], "--style cannot be used with a page; leave it out"),
    ],
)
def test_what_contradicts_is_refused(vsacli, feasible_result, options, message):
    ran = vsacli("plot", feasible_result, *options)
    assert ran.code == 2
    assert message in " ".join(ran.err.split())
    assert not list(Path().iterdir())


def test_a_look_needs_figures(vsacli):
    ran = vsacli("invdyn", ROBOT, REST_TO_REST, "--style", "slide")
    assert (ran.code, ran.err.splitlines()[-1]) == (2, "Error: --style needs --plot")


def test_pages_are_not_offered_where_there_are_none():
    for name in DRAWING:
        context = group.make_context("vsacli", [name, "--help"], resilient_parsing=True)
        options = {each.name: each for each in group.get_command(context, name).params}
        has_page = "html" in options["file_format"].type.choices
        assert has_page == (name in ("plot", "compare", "identify"))
