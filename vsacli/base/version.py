"""The version of the program, which its files record."""

__version__ = "0.1.0"
