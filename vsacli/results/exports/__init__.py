"""Variables of results and simulations for other programs: a selection, and a file for each format."""

from __future__ import annotations

from vsacli.base.lazy import LazyRegistry

FORMATS = LazyRegistry(
    {
        "csv": "vsacli.results.exports.csv_table:CSV",
        "mat": "vsacli.results.exports.mat_file:MAT",
        "parquet": "vsacli.results.exports.parquet_table:PARQUET",
        "joint-trajectory": "vsacli.results.exports.joint_trajectory:JOINT_TRAJECTORY",
    }
)
"""Formats by their names on a command line, each a `ResultFormat`."""
