"""Searches over timing, stiffness and branch: the smallest fix of an infeasible task, the optimal motion."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.studies.search.fix_report import Fix, Fixes
    from vsacli.studies.search.fix_search import fixes
    from vsacli.studies.search.fixed_files import check_fixed_target, fixed_paths, write_fixed
    from vsacli.studies.search.optimization import optimize, searches
    from vsacli.studies.search.optimum import Optimum
    from vsacli.studies.search.paced_motion import path_at

__all__ = [
    "Fix",
    "Fixes",
    "Optimum",
    "check_fixed_target",
    "fixed_paths",
    "fixes",
    "optimize",
    "path_at",
    "searches",
    "write_fixed",
]
__getattr__, __dir__ = lazy_exports(__name__)
