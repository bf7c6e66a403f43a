"""Pages of results and of what was measured: one HTML file each, with everything in it that it needs.

What is drawn is packed here, by the same envelopes, corridors and limits as in figures; how it looks and
acts is in `page.html`, `page.css` and the scripts beside them.
"""

from vsacli.results.pages.document import RemedyText
from vsacli.results.pages.measured_page import measured_page
from vsacli.results.pages.result_page import result_page
from vsacli.results.pages.study_page import study_page

__all__ = ["RemedyText", "measured_page", "result_page", "study_page"]
