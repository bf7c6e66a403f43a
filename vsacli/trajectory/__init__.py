"""Commanded signals over time, declared in a file or recorded in a laboratory."""
