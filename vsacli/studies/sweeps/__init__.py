"""Studies: many runs of a robot whose numbers vary, or along many trajectories, as a table."""

from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.merging import merge
from vsacli.studies.sweeps.study import Study, load_study
from vsacli.studies.sweeps.summary import StudySummary
from vsacli.studies.sweeps.sweep import Shard, compute, missing, write

__all__ = ["Journal", "Shard", "Study", "StudySummary", "compute", "load_study", "merge", "missing", "write"]
