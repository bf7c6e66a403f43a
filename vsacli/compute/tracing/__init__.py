"""Tracing: run on symbols, the text that NumPy runs leaves a program, which becomes Python or C."""

from vsacli.compute.tracing import traced_control_flow  # noqa: F401  (registers loops and branches of symbols)
from vsacli.compute.tracing.array import TracedArray, cells_of, trace
from vsacli.compute.tracing.program import Kind, Operand, Program, Symbol
from vsacli.compute.tracing.tape import Tape

__all__ = ["Kind", "Operand", "Program", "Symbol", "Tape", "TracedArray", "cells_of", "trace"]
