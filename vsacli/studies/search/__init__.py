"""Searches over timing, stiffness and preload: the smallest fix of an infeasible task, the optimal motion."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.studies.search.fixed_files import check_fixed_target, fixed_paths, write_fixed
    from vsacli.studies.search.fixes import suggest
    from vsacli.studies.search.optimization import optimize, searches
    from vsacli.studies.search.optimum import Optimum
    from vsacli.studies.search.paced_motion import path_at
    from vsacli.studies.search.suggestions import Remedy, Suggestions

__all__ = [
    "Optimum",
    "Remedy",
    "Suggestions",
    "check_fixed_target",
    "fixed_paths",
    "optimize",
    "path_at",
    "searches",
    "suggest",
    "write_fixed",
]
__getattr__, __dir__ = lazy_exports(__name__)
