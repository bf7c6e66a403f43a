"""One run of the inverse dynamics along a trajectory: its report, its self-check, and its result."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.analysis.report import Report
    from vsacli.analysis.result import Result, open_result
    from vsacli.analysis.run import inverse_dynamics

__all__ = [
    "Report",
    "Result",
    "inverse_dynamics",
    "open_result",
]
__getattr__, __dir__ = lazy_exports(__name__)
