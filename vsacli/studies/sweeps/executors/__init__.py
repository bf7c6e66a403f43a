"""Who computes the rows of a study: this process, several of this machine, or the workers of a cluster."""

from vsacli.studies.sweeps.executors.executor import Rows, executor

__all__ = ["Rows", "executor"]
