"""Spring laws of the transmissions, and the pairs of them that drive a joint.

Adding a law is adding a class derived from `SpringLaw` and its line in `LAWS`.
"""

from vsacli.springs.cubic import Cubic
from vsacli.springs.iterated import IteratedPair
from vsacli.springs.law import SpringLaw
from vsacli.springs.pair import Pair, PairSolution

LAWS: dict[str, type[SpringLaw]] = {"cubic": Cubic}
"""Laws by the name they have in a robot file."""

LAWS_NOT_YET = ("polynomial", "sinh", "exponential", "quadratic", "four_bar", "table")
"""Laws of the file format that this version does not act on."""

__all__ = ["LAWS", "LAWS_NOT_YET", "Pair", "PairSolution", "SpringLaw", "make_pair"]


def make_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    """The solver of (14) for two laws, side 1 preloaded upward: closed where one exists, else iterated."""
    return first.closed_pair(second) or IteratedPair(first, second)
