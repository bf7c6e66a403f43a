"""Strict reading of declared YAML documents and CSV tables. Robots and trajectories are unknown here."""
