"""Study files: `vsacli-study/1`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import (
    Check,
    Choice,
    Items,
    Name,
    Record,
    Text,
    check_fields,
    choice,
    integer,
    text,
    value,
)
from vsacli.documents.kinds.several import OneOrMore
from vsacli.studies.sweeps.kept import KEPT
from vsacli.studies.sweeps.optimised import Optimised
from vsacli.studies.sweeps.over_time import OVER_TIME
from vsacli.studies.sweeps.ways import Drawn, Ranged, Varied, Ways

FORMAT = "vsacli-study/1"
GRID = "grid"
METHODS = (GRID, "random", "latin_hypercube")

_COUNT = Check(lambda number: number >= 1, "1 or more", {"minimum": 1})
_SEED = Check(lambda number: number >= 0, "zero or more", {"minimum": 0})


class _ColumnName(Choice):
    """One of the scalars of a report; they are too many for a table."""

    words = "name of a column"


class _VariableName(Choice):
    """One of the variables of results, likewise."""

    words = "name of a variable"


@dataclass(frozen=True)
class StudyFile:
    """The content of a study file."""

    name: str = value(Name(), "name of the study")
    robot: str = text("path of the robot file, relative to this one")
    trajectory: tuple[str, ...] = value(
        OneOrMore(Text()),
        "path of a trajectory file, relative to this one; `*` stands for anything in its name",
    )
    vary: tuple[Varied, ...] = value(
        Ways(), "what varies, by the paths of `--set`; without it, only trajectories do", default=()
    )
    method: str = choice(METHODS, "which values are combined: all with all, or so many drawn", default=GRID)
    samples: int | None = integer(
        "runs of each trajectory that are drawn; absent if the method is grid", check=_COUNT, default=None
    )
    seed: int = integer("of what is drawn", check=_SEED, default=0)
    optimize: Optimised | None = value(
        Record(Optimised),
        "what is optimised in each run; all that is kept is of the optimum then",
        default=None,
    )
    keep: tuple[str, ...] | None = value(
        Items(_ColumnName(tuple(KEPT))),
        "what is kept of each run beside its verdict; all by default",
        default=None,
    )
    variables: tuple[str, ...] | None = value(
        Items(_VariableName(tuple(OVER_TIME))),
        "variables of results that are kept over time",
        default=None,
    )
    every: int = integer("of so many steps these variables are kept at one", check=_COUNT, default=1)

    def __post_init__(self) -> None:
        check_fields(self, *self._problems())

    def _problems(self) -> Iterator[FieldProblem]:
        if self.method != GRID and self.samples is None:
            yield FieldProblem(("samples",), f"how many runs? The method {self.method} draws them")
        if self.method == GRID and self.samples is not None:
            yield FieldProblem(("samples",), "a grid has as many runs as its values make; leave this key out")
        drawn = [varied.path for varied in self.vary if isinstance(varied.way, Drawn | Ranged)]
        if self.method == GRID and drawn:
            advice = "take the method random or latin_hypercube, or list values"
            yield FieldProblem(
                ("vary",), f"a grid has no values drawn from distributions, as of {drawn[0]}; {advice}"
            )
        if self.method != GRID and not self.vary:
            yield FieldProblem(("vary",), f"nothing varies that the method {self.method} could draw")
