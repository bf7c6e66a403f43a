"""Studies: many runs of a robot whose numbers vary, or along many trajectories, as a table."""

from vsacli.studies.sweeps.merging import merge
from vsacli.studies.sweeps.run_study import Shard, run_study
from vsacli.studies.sweeps.summary import StudySummary

__all__ = ["Shard", "StudySummary", "merge", "run_study"]
