"""Who carries out a computation on rows of samples: NumPy, or code from the system's C compiler."""

from vsacli.engine.choice import NAMES, NUMPY, Choice, choose
from vsacli.engine.engines import Engine, samples_per_pass
from vsacli.engine.kernel import Kernel

__all__ = ["NAMES", "NUMPY", "Choice", "Engine", "Kernel", "choose", "samples_per_pass"]
