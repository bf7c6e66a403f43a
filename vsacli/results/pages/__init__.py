"""Pages of results and of measurements: one self-contained HTML file each.

This package packs the charts, the same as in figures; their look and behavior are defined in `page.html`,
`page.css` and the scripts next to them.
"""

from vsacli.results.pages.document import FixText
from vsacli.results.pages.result_page import measured_page, result_page
from vsacli.results.pages.robot_page import robot_page
from vsacli.results.pages.study_page import study_page

__all__ = ["FixText", "measured_page", "result_page", "robot_page", "study_page"]
