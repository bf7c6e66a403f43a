"""Degrees that profiles made of polynomials may have."""

from __future__ import annotations

DEGREES = range(3, 16, 2)
"""Degrees of rest-to-rest polynomials."""

VIA_DEGREES = range(3, 10, 2)
"""Degrees of splines through points; those of higher degree lose too many digits."""
