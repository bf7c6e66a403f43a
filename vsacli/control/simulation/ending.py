"""What ends a run before its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vsacli.base.flags import Flag
from vsacli.base.units import time_text

DIVERGED = "diverged"
INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Ending:
    """Why a run ended early.

    Attributes:
        time: when, s.
        reason: what happened, as part of a sentence.
        flag: what marks the last step of the joint to blame.
        joint: its index; None, like the flag, if there is none.
        verdict: on a run that ends so, unless a flag says it.
    """

    time: float
    reason: str
    flag: Flag | None = None
    joint: int | None = None
    verdict: str = DIVERGED

    def described(self, joint_names: Sequence[str], first: float) -> str:
        """The end as a sentence; `first` is the stamp of time zero, s."""
        place = "" if self.joint is None else f"{joint_names[self.joint]}: "
        return f"{place}{self.reason}; ended at t = {time_text(first + self.time)}"
