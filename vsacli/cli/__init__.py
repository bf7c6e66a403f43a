"""The command line; only this package prints and sets exit codes."""

from vsacli.cli.main import main

__all__ = ["main"]
