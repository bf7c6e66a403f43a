"""Export of variables of results and simulations: a selection, and a file format for other programs."""

from __future__ import annotations

from vsacli.base.lazy import LazyRegistry

FORMATS = LazyRegistry(
    {
        "csv": "vsacli.results.exports.formats:CSV",
        "mat": "vsacli.results.exports.formats:MAT",
        "parquet": "vsacli.results.exports.formats:PARQUET",
        "joint-trajectory": "vsacli.results.exports.formats:JOINT_TRAJECTORY",
    }
)
"""Formats by their names on the command line, each a `ResultFormat`."""
