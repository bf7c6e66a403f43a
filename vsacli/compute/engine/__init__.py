"""Backends of computations on rows of samples: NumPy, or code from a C compiler."""

from vsacli.compute.engine.choice import (
    NAMES,
    NUMPY,
    ChosenEngine,
    Settled,
    choose_engine,
    processor_count,
    settle_engine,
)
from vsacli.compute.engine.engines import KEPT_PROGRAMS, Engine, Kernel, samples_per_pass
from vsacli.compute.engine.number_engine import NUMBERS, engine_of_call

__all__ = [
    "KEPT_PROGRAMS",
    "NAMES",
    "NUMBERS",
    "NUMPY",
    "ChosenEngine",
    "Engine",
    "Kernel",
    "Settled",
    "choose_engine",
    "engine_of_call",
    "processor_count",
    "samples_per_pass",
    "settle_engine",
]
