"""Signals recorded in a laboratory: reading of CSV tables, checks, and profiles from samples."""
