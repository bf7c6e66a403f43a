"""Programs recorded from computations: run on symbols, the text that NumPy runs leaves its operations."""

from vsacli.tracing import nested  # noqa: F401  (so that `vsacli.loops` knows arrays of symbols)
from vsacli.tracing.array import TracedArray, cells_of
from vsacli.tracing.program import Program
from vsacli.tracing.pruning import Listing
from vsacli.tracing.symbol import Kind, Operand, Symbol
from vsacli.tracing.tape import Tape

__all__ = ["Kind", "Listing", "Operand", "Program", "Symbol", "Tape", "TracedArray", "cells_of"]
