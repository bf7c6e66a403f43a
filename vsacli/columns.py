"""Which column of a recorded trajectory is which quantity of which joint."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from vsacli.errors import InputError, Problem
from vsacli.profiles import POSITION, STIFFNESS, WRENCH, Signal
from vsacli.suggestions import did_you_mean
from vsacli.wrench import wrench_columns

TIME = "time"
JOINT_SIGNALS = (POSITION, STIFFNESS)
SIGNALS = (*JOINT_SIGNALS, WRENCH)

Layout = dict[str, dict[int, int]]
"""For each quantity that a table has, e.g. `dq`, the index of a column by that of its joint (wrench axis)."""

Way = dict[str, dict[int, str]]
"""For each quantity the names of its columns, by index of the joint (wrench axis)."""

_PATTERNS = ("{joint}.{name}", "{name}{number}")

_WRENCH_WAY: Way = {name: dict(enumerate(wrench_columns(name))) for name in WRENCH.names}


def column_layout(
    header: Sequence[str],
    joint_names: Sequence[str],
    wanted: Sequence[Signal],
    file: str,
    without_stiffness: Collection[str] = (),
) -> Layout:
    """Where the quantities stand in a table.

    Columns of joints are named `<joint>.<quantity>`, or `<quantity><i>` with i counted from 1; one way
    throughout. Those of the wrench are named by `wrench_columns`.

    Args:
        header: names of all columns, none twice.
        joint_names: the joints, each of which must have a column of each quantity that any joint has.
        wanted: signals whose values must be there; their derivatives are optional.
        file: named in errors.
        without_stiffness: joints that need no stiffness; columns of it are admitted, but not in the layout.

    Raises:
        InputError: all that is wrong with the header.
    """
    everything = [column for pattern in _PATTERNS for column in _all(_columns(pattern, joint_names))]
    ways = [_columns(pattern, joint_names, without_stiffness) for pattern in _PATTERNS]
    used = [way for way in ways if any(column in header for column in _all(way))]
    way = used[0] if used else ways[0]
    expected = [TIME, *_all(way), *(_all(_WRENCH_WAY) if WRENCH in wanted else ())]

    problems = list(_strangers(header, expected, {TIME, *everything, *_all(_WRENCH_WAY)}))
    way = way | _WRENCH_WAY
    if len(used) == len(ways):
        examples = " and ".join(
            repr(next(column for column in header if column in _all(way))) for way in ways
        )
        problems.append(f"columns are named both by joint and by number ({examples}); use one way")
    else:
        problems += _gaps(header, way, {signal.names[0] for signal in wanted})
    if problems:
        raise InputError(Problem(file, 1, problem) for problem in problems)
    return {
        name: {index: header.index(column) for index, column in columns.items()}
        for name, columns in way.items()
        if all(column in header for column in columns.values())
    }


def _columns(pattern: str, joint_names: Sequence[str], without_stiffness: Collection[str] = ()) -> Way:
    """The columns of the joints."""
    return {
        name: {
            index: pattern.format(name=name, joint=joint, number=index + 1)
            for index, joint in enumerate(joint_names)
            if signal is not STIFFNESS or joint not in without_stiffness
        }
        for signal in JOINT_SIGNALS
        for name in signal.names
    }


def _all(way: Way) -> list[str]:
    return [column for columns in way.values() for column in columns.values()]


def _strangers(header: Sequence[str], expected: Sequence[str], known: Collection[str]) -> Iterator[str]:
    meant = [column for column in expected if column not in header]
    for column in header:
        if column not in known:
            yield f"unknown column {column!r}{did_you_mean(column, meant)}"


def _gaps(header: Sequence[str], way: Way, needed: Collection[str]) -> Iterator[str]:
    if TIME not in header:
        yield f"there is no column {TIME!r}"
    for name, columns in way.items():
        absent = [column for column in columns.values() if column not in header]
        if absent and name in needed:
            yield f"there is no column {', '.join(absent)}"
        elif absent and len(absent) < len(columns):
            every = "axes" if name in WRENCH.names else "joints"
            yield f"there is no column {', '.join(absent)}; {name} is given for all {every} or for none"
