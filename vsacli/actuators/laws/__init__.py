"""Spring laws of the transmissions.

Adding a law is adding a class derived from `SpringLaw` and its line in `LAWS`.
"""

from vsacli.actuators.laws.law import SpringLaw
from vsacli.base.lazy import OnDemand

LAWS = OnDemand(
    {
        "cubic": "vsacli.actuators.laws.cubic:Cubic",
        "polynomial": "vsacli.actuators.laws.polynomial:Polynomial",
        "sinh": "vsacli.actuators.laws.sinh:Sinh",
        "exponential": "vsacli.actuators.laws.exponential:Exponential",
        "quadratic": "vsacli.actuators.laws.quadratic:Quadratic",
        "four_bar": "vsacli.actuators.laws.four_bar:FourBar",
        "table": "vsacli.actuators.laws.table:MeasuredSpring",
    }
)
"""Laws by the name they have in a robot file."""

__all__ = ["LAWS", "SpringLaw"]
