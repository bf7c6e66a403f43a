"""Questions that take many runs: what would make an infeasible motion possible."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.studies.remedies import suggest

__all__ = [
    "suggest",
]
__getattr__, __dir__ = lazy_exports(__name__)
