"""Equations of motors and springs."""
