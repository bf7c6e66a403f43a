"""Programs recorded from computations: run on symbols, the text that NumPy runs leaves its operations."""

from vsacli.compute.tracing import control_flow as nested  # noqa: F401  (so that `vsacli.loops` knows arrays of symbols)
from vsacli.compute.tracing.array import TracedArray, cells_of
from vsacli.compute.tracing.dead_code import Listing
from vsacli.compute.tracing.program import Program
from vsacli.compute.tracing.symbol import Kind, Operand, Symbol
from vsacli.compute.tracing.tape import Tape

__all__ = ["Kind", "Listing", "Operand", "Program", "Symbol", "Tape", "TracedArray", "cells_of"]
