"""Questions beyond a run: what would make a motion possible, and how far a measured one is from it."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.studies.measured import Comparison, compare
    from vsacli.studies.remedies import suggest
    from vsacli.studies.sensitivities import Sensitivity, sensitivity

__all__ = [
    "Comparison",
    "Sensitivity",
    "compare",
    "sensitivity",
    "suggest",
]
__getattr__, __dir__ = lazy_exports(__name__)
