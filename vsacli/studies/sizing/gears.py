"""Which gear ratios motors may be combined with: listed ones, or any of a range."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple, Self

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError

_RANGE = re.compile(r"(?P<low>[^,]+?)\s*\.\.\s*(?P<high>[^,]+)")
FORM = "expected ratios such as 50,80,100, or a range such as 30..160"


class Gears(NamedTuple):
    """Ratios that a motor may be combined with; all of them positive, rad/m at a prismatic joint.

    Attributes:
        listed: the ratios there are; empty if any between two ends may be.
        low, high: these ends.
    """

    listed: tuple[float, ...] = ()
    low: float = 0.0
    high: float = math.inf

    @classmethod
    def read(cls, text: str) -> Self:
        """Ratios such as `50,80,100`, or a range such as `30..160`.

        Raises:
            InputError: it is none of both.
        """
        ends = _RANGE.fullmatch(text.strip())
        words = text.split(",") if ends is None else [ends["low"], ends["high"]]
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            raise InputError.one(f"{FORM}, found {text!r}") from None
        if not all(0 < number < math.inf for number in numbers):
            raise InputError.one(f"gear ratios must be positive and finite, not {text!r}")
        if ends is None:
            return cls(listed=tuple(sorted(set(numbers))))
        low, high = numbers
        if low > high:
            raise InputError.one(f"the range {text!r} of gear ratios is empty; the smaller one comes first")
        return cls(low=low, high=high)


def gears_of_joints(texts: Sequence[str], joints: Sequence[str]) -> dict[str, Gears]:
    """The gears of each joint.

    Args:
        texts: as `Gears.read` takes them, for all joints, or as `slide=500..3000` for one of them.
        joints: their names.

    Raises:
        InputError: a text is no such thing, names no joint, or says twice what one has.
    """
    common: Gears | None = None
    found: dict[str, Gears] = {}
    for text in texts:
        name, equals, ratios = (part.strip() for part in text.rpartition("="))
        gears = Gears.read(ratios)
        if equals and name not in joints:
            raise InputError.one(f"{text!r}: there is no joint {name!r}{did_you_mean(name, joints)}")
        if name in found or (not equals and common is not None):
            raise InputError.one(f"{text!r}: the gears of {name or 'all joints'} were given already")
        if equals:
            found[name] = gears
        else:
            common = gears
    return {joint: found.get(joint, common or Gears()) for joint in joints}
