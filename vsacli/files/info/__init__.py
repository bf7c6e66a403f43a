"""Descriptions of files as JSON values and as text."""

from vsacli.files.info.describe import clear_cache, describe_cache, describe_file, described_value
from vsacli.files.info.text import render

__all__ = ["clear_cache", "describe_cache", "describe_file", "described_value", "render"]
