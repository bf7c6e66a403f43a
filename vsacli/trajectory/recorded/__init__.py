"""Signals recorded in a laboratory: columns of a CSV table."""
