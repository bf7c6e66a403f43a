"""What would mend an infeasible task: the smallest slow-down, stiffness offset, or change of profile."""

from vsacli.studies.remedies.fixed_file import check_fixed_target, fixed_paths, write_fixed
from vsacli.studies.remedies.smallest_changes import suggest
from vsacli.studies.remedies.suggestions import StiffnessProfile, Suggestions

__all__ = [
    "StiffnessProfile",
    "Suggestions",
    "check_fixed_target",
    "fixed_paths",
    "suggest",
    "write_fixed",
]
