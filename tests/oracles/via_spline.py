"""The spline through points from rest to rest, by its conditions piece by piece, in exact fractions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

from sympy import QQ
from sympy.polys.matrices import DomainMatrix

Pieces = list[list[Fraction]]


def spline_pieces(times: Sequence[Fraction], values: Sequence[Fraction], degree: int) -> Pieces:
    """Coefficients of powers 0 to degree of the time since the start of each piece.

    Each piece takes the values at both its ends; derivatives 1 to degree-1 agree where two pieces meet, and
    derivatives 1 to (degree-1)/2 vanish at the outer ends.
    """
    lengths = [after - before for before, after in pairwise(times)]
    width, last = degree + 1, len(lengths) - 1
    rows: list[list[Fraction]] = []
    right: list[Fraction] = []

    def condition(value: Fraction, *terms: tuple[int, list[Fraction]]) -> None:
        row = [Fraction(0)] * (width * len(lengths))
        for piece, coefficients in terms:
            row[piece * width : (piece + 1) * width] = coefficients
        rows.append(row)
        right.append(value)

    for piece, length in enumerate(lengths):
        condition(values[piece], (piece, _powers(degree, 0, Fraction(0))))
        condition(values[piece + 1], (piece, _powers(degree, 0, length)))
    for piece in range(last):
        for order in range(1, degree):
            after = [-c for c in _powers(degree, order, Fraction(0))]
            condition(Fraction(0), (piece, _powers(degree, order, lengths[piece])), (piece + 1, after))
    for order in range(1, (degree + 1) // 2):
        condition(Fraction(0), (0, _powers(degree, order, Fraction(0))))
        condition(Fraction(0), (last, _powers(degree, order, lengths[last])))

    matrix = DomainMatrix(
        [[QQ(c.numerator, c.denominator) for c in row] for row in rows], (len(rows),) * 2, QQ
    )
    vector = DomainMatrix([[QQ(c.numerator, c.denominator)] for c in right], (len(right), 1), QQ)
    solution = [
        Fraction(int(c.numerator), int(c.denominator)) for c in matrix.lu_solve(vector).to_list_flat()
    ]
    return [solution[start : start + width] for start in range(0, len(solution), width)]


def spline_value(times: Sequence[Fraction], pieces: Pieces, time: Fraction, order: int) -> Fraction:
    """A derivative of the spline; at a point that of the piece which begins there."""
    piece = max(index for index in range(len(pieces)) if index == 0 or times[index] <= time)
    powers = _powers(len(pieces[0]) - 1, order, time - times[piece])
    return sum((c * p for c, p in zip(pieces[piece], powers, strict=True)), Fraction(0))


def _powers(degree: int, order: int, elapsed: Fraction) -> list[Fraction]:
    """Derivatives of the powers 0 to degree."""
    return [
        Fraction(math.perm(power, order)) * elapsed ** (power - order) if power >= order else Fraction(0)
        for power in range(degree + 1)
    ]
