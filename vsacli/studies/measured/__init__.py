"""Comparison of results with laboratory measurements, and with each other."""

from vsacli.studies.measured.against_result import compare
from vsacli.studies.measured.agreement import Comparison, compare_results

__all__ = ["Comparison", "compare", "compare_results"]
