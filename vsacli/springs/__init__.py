"""Spring laws of the transmissions, and the pairs of them that drive a joint.

Adding a law is adding a class derived from `SpringLaw` and its line in `LAWS`.
"""

from functools import lru_cache

from vsacli.on_demand import OnDemand
from vsacli.springs.law import SpringLaw
from vsacli.springs.pair import Pair, PairSolution

LAWS = OnDemand(
    {
        "cubic": "vsacli.springs.cubic:Cubic",
        "polynomial": "vsacli.springs.polynomial:Polynomial",
        "sinh": "vsacli.springs.sinh:Sinh",
        "exponential": "vsacli.springs.exponential:Exponential",
        "quadratic": "vsacli.springs.quadratic:Quadratic",
        "four_bar": "vsacli.springs.four_bar:FourBar",
        "table": "vsacli.springs.table:MeasuredSpring",
    }
)
"""Laws by the name they have in a robot file."""

__all__ = ["LAWS", "Pair", "PairSolution", "SpringLaw", "make_pair"]


@lru_cache(maxsize=1024)
def make_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    """The solver of (14) for two laws, side 1 preloaded upward: closed where one exists, else iterated.

    Equal laws get the same pair, which keeps what it has found out about them.
    """
    closed = first.closed_pair(second)
    if closed is not None:
        return closed
    from vsacli.springs.iterated import IteratedPair

    return IteratedPair(first, second)
