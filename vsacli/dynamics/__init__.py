"""Equations (36)-(74) over blocks of samples, and the forward dynamics."""
