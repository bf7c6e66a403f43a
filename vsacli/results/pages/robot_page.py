"""The page of a robot: its figures, its parameters and its files, without scripts."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence

from vsacli.base.texts import for_terminal, one_line
from vsacli.results.pages.document import InputText, filled

TEMPLATE = "robot.html"


def robot_page(name: str, figures: Mapping[str, bytes], text: str, inputs: Sequence[InputText]) -> str:
    """Return the page of a robot, as HTML.

    Args:
        name: name of the robot.
        figures: figures as SVG, by words for readers who do not see them.
        text: description of the robot, as of `vsacli info`.
        inputs: robot file, and the files that it names.
    """
    return filled(
        TEMPLATE,
        title=one_line(name),
        figures={words: base64.b64encode(image).decode("ascii") for words, image in figures.items()},
        text="\n".join(map(for_terminal, text.splitlines())),
        inputs=inputs,
    )
