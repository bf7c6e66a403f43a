"""Strict reading of declared YAML documents and CSV tables. Knows files and fields, not robots."""
