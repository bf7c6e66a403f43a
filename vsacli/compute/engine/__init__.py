"""Backends of computations on rows of samples: NumPy, or code from a C compiler."""

from vsacli.compute.engine.choice import NAMES, NUMPY, Choice, Settled, choose, processors, settle
from vsacli.compute.engine.engines import Engine, Kernel, samples_per_pass

__all__ = [
    "NAMES",
    "NUMPY",
    "Choice",
    "Engine",
    "Kernel",
    "Settled",
    "choose",
    "processors",
    "samples_per_pass",
    "settle",
]
