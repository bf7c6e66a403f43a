"""The picture of a page, taken by a browser; where there is none, the one that is there stays."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

SIZE = "1400,1480"
"""Pixels: down to the second row of plots."""

SWITCHES = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--hide-scrollbars", f"--window-size={SIZE}"),
    "--virtual-time-budget=8000",  # ms; the page is drawn after a second or two
)


def take_picture(page: Path, picture: Path) -> None:
    """Take a picture of the upper end of a page."""
    browser = shutil.which("chromium")
    if browser is None:
        return
    with tempfile.TemporaryDirectory() as profile:
        places = [f"--user-data-dir={profile}", f"--screenshot={picture}"]
        subprocess.run(
            [browser, *SWITCHES, *places, page.as_uri()], check=True, capture_output=True, timeout=120
        )
