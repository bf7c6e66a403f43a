"""The images of the pages: those of the tool are drawn by the commands that stand beside them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Iterable
from pathlib import Path

from five_figures import draw as draw_five_figures
from noise_study import draw as draw_noise
from page_picture import take_picture

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"

DRAWING = ("figures.md", "gallery.md", "optimization.md", "sizing.md", "studies.md")
"""Pages whose commands draw the figures of the tool, wherever they are shown."""

FILE_OR_COMMANDS = re.compile(
    r"(?:^Save as `(?P<name>\S+)`:\n\n)?^```(?:yaml|csv|sh)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
IMAGE = re.compile(r"\]\(images/(\S+\.png)\)")


def draw_images(pages: Iterable[Path]) -> None:
    """Draw the pictures of the pages: those of the tool by the commands that stand beside them."""
    shown = {name for page in pages for name in IMAGE.findall(page.read_text(encoding="utf-8"))}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("robots", "trajectories"):
            shutil.copytree(ROOT / name, Path(folder) / name)
        for page in DRAWING:
            _do_what_it_says(ROOT / "docs" / page, Path(folder))
        for drawn in Path(folder).rglob("*.png"):
            if drawn.name in shown:
                shutil.copy(drawn, IMAGES)
        take_picture(Path(folder) / "pages" / "hasty.html", IMAGES / "page.png")
    draw_noise(IMAGES / "recorded-noise.png")
    draw_five_figures(IMAGES)


def _do_what_it_says(page: Path, folder: Path) -> None:
    """Save the files of a page and run its commands; that they work is for the tests."""
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    for block in FILE_OR_COMMANDS.finditer(page.read_text(encoding="utf-8")):
        if block["name"]:
            (folder / block["name"]).write_text(block["text"], encoding="utf-8")
        else:
            environment = {**os.environ, "PATH": path}
            subprocess.run(["sh", "-c", block["text"]], cwd=folder, env=environment, check=False)
