"""Slips of units in files that come along, by what they are slips of."""

from samples.slips import of_drives, of_links, of_motions
from samples.slips.slip import Slip

__all__ = ["FURTHER", "REST", "TYPICAL", "Slip"]

TYPICAL = [*of_motions.TYPICAL, *of_links.TYPICAL, *of_drives.TYPICAL]
"""Written down first; the rules were made for such."""

FURTHER = [*of_motions.FURTHER, *of_links.FURTHER, *of_drives.FURTHER]
"""Written down before bounds were set by looking at any."""

REST = [*of_motions.REST, *of_links.REST, *of_drives.REST]
"""For the rules that these do not call."""
