"""Comparison of laboratory measurements with results."""

from vsacli.studies.measured.against_result import compare
from vsacli.studies.measured.agreement import Comparison

__all__ = ["Comparison", "compare"]
