"""Studies: many runs of a robot with varied parameters, or along many trajectories, as a table."""

from vsacli.studies.sweeps.run_study import merge, run_study
from vsacli.studies.sweeps.summary import StudySummary

__all__ = ["StudySummary", "merge", "run_study"]
