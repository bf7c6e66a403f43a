"""Variables of results and simulations for other programs: a selection, and a file for each format."""

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
"""Formats by their names on a command line, each a `ResultFormat`."""
