"""What would mend an infeasible task: slower, with another stiffness or preload, or all together."""

from vsacli.studies.remedies.fixed_file import check_fixed_target, fixed_paths, write_fixed
from vsacli.studies.remedies.smallest_changes import suggest
from vsacli.studies.remedies.suggestions import Remedy, Suggestions

__all__ = [
    "Remedy",
    "Suggestions",
    "check_fixed_target",
    "fixed_paths",
    "suggest",
    "write_fixed",
]
