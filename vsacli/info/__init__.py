"""What a file holds, as plain values for JSON and as text."""

from vsacli.info.file import describe_file
from vsacli.info.selection import bare, select
from vsacli.info.text import render

__all__ = ["bare", "describe_file", "render", "select"]
