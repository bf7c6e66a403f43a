"""Spring laws of the transmissions, and the pairs of them that drive a joint.

Adding a law is adding a class derived from `SpringLaw` and its line in `LAWS`.
"""

from vsacli.springs.cubic import Cubic
from vsacli.springs.exponential import Exponential
from vsacli.springs.four_bar import FourBar
from vsacli.springs.iterated import IteratedPair
from vsacli.springs.law import SpringLaw
from vsacli.springs.pair import Pair, PairSolution
from vsacli.springs.polynomial import Polynomial
from vsacli.springs.quadratic import Quadratic
from vsacli.springs.sinh import Sinh
from vsacli.springs.table import MeasuredSpring

LAWS: dict[str, type[SpringLaw]] = {
    "cubic": Cubic,
    "polynomial": Polynomial,
    "sinh": Sinh,
    "exponential": Exponential,
    "quadratic": Quadratic,
    "four_bar": FourBar,
    "table": MeasuredSpring,
}
"""Laws by the name they have in a robot file."""

__all__ = ["LAWS", "Pair", "PairSolution", "SpringLaw", "make_pair"]


def make_pair(first: SpringLaw, second: SpringLaw) -> Pair:
    """The solver of (14) for two laws, side 1 preloaded upward: closed where one exists, else iterated."""
    return first.closed_pair(second) or IteratedPair(first, second)
