"""Public names that changed before version 0.1, each with its successor.

A name that is not known is looked up here (`did_you_mean`), so that its error says what it is called now.
`docs/renamed.md` lists them all.
"""

from __future__ import annotations

import re
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


_STORED = "results and simulations, `--variables`, Python, generated C"
_SIMULATED = "simulations, `--variables`, recordings, Python"

RENAMINGS: tuple[Renaming, ...] = (
    Renaming("variable", "tau_spring", "tau_transmission", _STORED),
    Renaming("variable", "stiffness_lower", "stiffness_min", _STORED),
    Renaming("variable", "stiffness_upper", "stiffness_max", _STORED),
    Renaming("Python name", "stiffness_min", "commanded_min", "`JointReport`"),
    Renaming("Python name", "stiffness_max", "commanded_max", "`JointReport`"),
    *(
        Renaming("variable", name, f"{name}_ref", "simulations: the command")
        for name in ("q", "dq", "ddq", "stiffness", "dstiffness")
    ),
    Renaming("variable", "tau_motor", "tau_motor_cmd", "simulations: the command"),
    *(
        Renaming("variable", f"{name}_actual", name, _SIMULATED)
        for name in (
            *("q", "dq", "ddq", "stiffness", "dstiffness", "tau_e", "phi", "dphi", "theta", "dtheta"),
            *("tau_motor", "elastic_energy", "motor_power", "motor_energy", "det_A", "damping"),
            *("tau_damper", "dissipated_power", "current", "voltage", "copper_loss"),
        )
    ),
    Renaming("variable", "tau_spring_actual", "tau_transmission", _SIMULATED),
)


def successor(word: str, valid: Iterable[str]) -> str | None:
    """Return the present name of a renamed word, or of a column with one, if it is valid, else None."""
    options = set(valid)
    return next((new for each in RENAMINGS if (new := _replaced(each, word)) in options), None)


def now_called(word: str, valid: Iterable[str]) -> str:
    """Return a clause to append to an error, `; it is now 'x'`; empty if the word was not renamed."""
    new = successor(word, valid)
    return "" if new is None else f"; it is now {new!r}"


def _replaced(renaming: Renaming, word: str) -> str | None:
    """Return a word with its new name, e.g. of the column `elbow.tau_motor_actual_1`; None without one."""
    if word == renaming.old:
        return renaming.new
    if renaming.kind != "variable" or renaming.old not in word:
        return None
    beginning, ending = r"(^|(?<=\.))", r"(?=\d*(_shaft)?(_[12])?$)"
    column, count = re.subn(beginning + re.escape(renaming.old) + ending, renaming.new, word)
    return column if count else None
