"""Public names that changed before version 0.1, each with its successor.

A name that is not known is looked up here (`did_you_mean`), so that its error says what it is called now.
`docs/renamed.md` lists them all.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Renaming(NamedTuple):
    """A public name that changed: a table of the documentation has a row for each.

    Attributes:
        kind: kind of name, such as "option" or "variable".
        old: the name before.
        new: the name now.
        place: command, file or function that has it.
    """

    kind: str
    old: str
    new: str
    place: str


RENAMINGS: tuple[Renaming, ...] = (
    Renaming("option", "--near-singular", "--min-margin", "check-feasibility"),
    Renaming("option", "--margin", "--min-margin", "optimize"),
    Renaming("key of studies", "margin", "min_margin", "optimize"),
    Renaming("parameter", "near_singular", "min_margin", "suggest"),
    Renaming("parameter", "margin", "min_margin", "optimize"),
    Renaming("key of reports", "near_singular", "min_margin", "suggestions of check-feasibility"),
    Renaming("key of reports", "margin", "min_margin", "optimize"),
    Renaming("option", "--tolerance", "--goal-tolerance", "simulate"),
    Renaming("option", "--measure", "--feedback", "simulate"),
    Renaming("parameter", "measured", "feedback", "simulate"),
    Renaming("option", "--deflections", "--deflection-solver", "invdyn, check-feasibility"),
    Renaming("value", "integrate", "ode", "--deflection-solver, deflections.method of reports"),
    Renaming("parameter", "deflections", "deflection_solver", "inverse_dynamics"),
    Renaming("option", "--begins-at", "--time-offset", "compare"),
    Renaming("parameter", "begins_at", "time_offset", "compare"),
    Renaming("key of reports", "begins_at", "time_offset", "compare"),
    Renaming("value", "copper", "copper_loss", "minimize of optimize, size and studies"),
    Renaming("value", "utilisation", "utilization", "minimize of size"),
    Renaming("option", "--catalogue", "--catalog", "size"),
    Renaming("parameter", "catalogue", "catalog", "size_drives"),
    Renaming("key of reports", "catalogue", "catalog", "size"),
    Renaming("key of reports", "minimised", "minimized", "optimize"),
    Renaming("key of reports", "begins_at_error", "time_offset_error", "compare"),
)


def successor(word: str, valid: Iterable[str]) -> str | None:
    """Return the present name of a renamed word if it is among the valid ones, else None."""
    options = set(valid)
    return next((each.new for each in RENAMINGS if each.old == word and each.new in options), None)
