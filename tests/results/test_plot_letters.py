"""Names in letters that the usual font has not."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import FontEntry
from samples.figures import rest_to_rest
from samples.marks import slow

from vsacli.results.plots import plot_stored, save_figures
from vsacli.results.plots import styles as letters

SERIF = letters.findfont("DejaVu Serif")


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> list[FontEntry]:
    """The fonts of the machine: none, unless a test adds some."""
    fonts: list[FontEntry] = []
    monkeypatch.setattr(letters, "installed_fonts", lambda: iter(fonts))
    letters.further_fonts.cache_clear()
    return fonts


def title(written: str) -> str:
    figure = Figure()
    figure.suptitle(written, parse_math=False)
    letters.make_legible(figure)
    return figure.get_suptitle()


@pytest.mark.usefixtures("installed")
def test_letters_without_a_font_become_their_codes() -> None:
    assert title("机器 arm 🤖") == r"\u673a\u5668 arm \U0001f916"
    assert title("плечо, ώμος, naïve") == "плечо, ώμος, naïve"
    assert title("$x_1$ \\frac{") == "$x_1$ \\frac{"


def test_letters_of_an_installed_font_are_drawn_with_it(installed: list[FontEntry]) -> None:
    installed.append(FontEntry(fname=SERIF, name="DejaVu Serif", weight=letters.REGULAR_WEIGHT))
    figure = Figure()
    figure.suptitle("arm ⎷", parse_math=False)  # which the usual font has not
    letters.make_legible(figure)
    assert figure.get_suptitle() == "arm ⎷"
    assert figure.texts[0].get_fontfamily() == [letters.DEFAULT_FONT, "DejaVu Serif"]


def test_a_font_that_cannot_be_read_has_no_letters(tmp_path: Path, installed: list[FontEntry]) -> None:
    (tmp_path / "broken.ttf").write_bytes(b"no font")
    installed.append(
        FontEntry(fname=str(tmp_path / "broken.ttf"), name="Broken", weight=letters.REGULAR_WEIGHT)
    )
    assert title("机") == r"\u673a"


def test_pictures_of_scripts_are_no_letters() -> None:
    """Matplotlib brings a font with one for every letter there is."""
    assert not any(font.name.startswith("Last Resort") for font in letters.installed_fonts())


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("file_format", ["png", slow("pdf"), slow("svg")])
def test_no_letter_makes_matplotlib_warn(tmp_path: Path, file_format: str) -> None:
    """Warnings are errors here."""
    result = rest_to_rest()
    result.robot_name, result.joint_names = "机器人 $\\alpha$", ("肩", "🤖", "_x")
    figures = {"elastic-torque": plot_stored(result)["elastic-torque"]}
    save_figures(figures, tmp_path, "run", file_format)
    labels = [text.get_text() for text in figures["elastic-torque"].legends[0].get_texts()]
    assert labels == [r"\u80a9", r"\U0001f916", "_x"]
