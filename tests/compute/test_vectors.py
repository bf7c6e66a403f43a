"""Vectors whose exact zeros and ones cost nothing."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest

from vsacli.compute.vector import Vector, cross

A, B = Vector(Fraction(2), Fraction(3), Fraction(5)), Vector(Fraction(7), Fraction(-11), Fraction(13))


@pytest.mark.parametrize("direction", list(product((0, 1, Fraction(-3, 4)), repeat=3)))
def test_of_a_product_along_a_direction_only_what_counts_is_computed(direction):
    along = Vector(*direction)
    found = cross(A, B, along=along)
    assert found.dot(along) == cross(A, B).dot(along)
    for computed, whole, factor in zip(found, cross(A, B), along, strict=True):
        assert computed == (whole if factor else 0)


def test_the_product_of_two_vectors():
    assert cross(A, B) == (3 * 13 + 5 * 11, 5 * 7 - 2 * 13, -2 * 11 - 3 * 7)
    assert cross(A, A) == (0, 0, 0)
