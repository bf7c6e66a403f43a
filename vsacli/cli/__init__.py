"""The command line: the only place that prints and sets exit codes."""

from vsacli.cli.main import main

__all__ = ["main"]
