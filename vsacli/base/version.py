"""The version of the program, which is stored in its files."""

__version__ = "0.1.0"
