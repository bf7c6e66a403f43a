"""Descriptions of files as JSON values and as text."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.files.info.cache_info import clear_cache, describe_cache
    from vsacli.files.info.describe import describe_file, described_value
    from vsacli.files.info.text import render

__all__ = ["clear_cache", "describe_cache", "describe_file", "described_value", "render"]
__getattr__, __dir__ = lazy_exports(__name__)
