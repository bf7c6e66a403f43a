"""Equations of records, and the numbers that satisfy them best."""
