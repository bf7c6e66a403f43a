"""Which degrees polynomials and splines must have for position, stiffness and wrench to be smooth enough."""

from __future__ import annotations

from vsacli.documents.fields import Check
from vsacli.trajectory.curves import DEGREES, VIA_DEGREES


def _odd(degrees: range, reason: str) -> Check:
    words = f"odd, {degrees[0]} to {degrees[-1]} ({reason})"
    return Check(lambda degree: degree in degrees, words, {"enum": list(degrees)})


def _from(lowest: int, degrees: range) -> range:
    return range(lowest, degrees.stop, degrees.step)


_MOTION = (
    "the motion must be four times differentiable, so all derivatives up to the third must vanish at the ends"
)
_RIGID_MOTION = "the motion must be twice differentiable, so its velocity must vanish at the ends"
_STIFFNESS = "the stiffness must be twice differentiable, so its rate must vanish at the ends"
_WRENCH = "the wrench must be twice differentiable, so its rate must vanish at the ends"
_STEPPED = (
    "it must be twice continuously differentiable, so two derivatives must vanish where it begins to change"
)

POSITION = _odd(_from(7, DEGREES), _MOTION)
RIGID_POSITION = _odd(DEGREES, _RIGID_MOTION)
STIFFNESS = _odd(DEGREES, _STIFFNESS)
WRENCH = _odd(DEGREES, _WRENCH)
STEPPED = _odd(_from(5, DEGREES), _STEPPED)

POSITION_VIA = _odd(_from(7, VIA_DEGREES), _MOTION)
RIGID_POSITION_VIA = _odd(VIA_DEGREES, _RIGID_MOTION)
STIFFNESS_VIA = _odd(VIA_DEGREES, _STIFFNESS)
