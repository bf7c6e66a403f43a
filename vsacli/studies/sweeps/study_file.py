"""Study files, `vsacli-study/1`: their fields, the forms of variation, and the optimization of each run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.flags import MIN_MARGIN, SINGULAR_MARGIN
from vsacli.documents.fields import (
    Check,
    Items,
    Name,
    OneOrMore,
    OwnKind,
    RecordOf,
    Refer,
    Schema,
    Share,
    Text,
    WordChoice,
    choice,
    integer,
    text,
    value,
)
from vsacli.documents.reading import check_path_of_change
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.tree import INVALID, ListNode, MapNode, Node, Scope, TextNode, plain
from vsacli.robot.model import Robot
from vsacli.studies.sensitivities.tolerances import SHAPES
from vsacli.studies.sweeps.columns import JOINT, KEPT, OVER_TIME, TIME, Column
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.studies.search.optimum import Optimum


SPACED = ("linspace", "logspace")
LINKED, FACTOR = "linked", "factor"
FORMS = (
    "a list of values, {linspace: [first, last, count]}, {logspace: [first, last, count]}, {normal: 5 %}, "
    "{uniform: 5 %}, {uniform: [least, largest]} or {linked: path, factor: 2}"
)


class Listed(NamedTuple):
    """A list of values, as in files."""

    values: tuple[Any, ...]


class Spaced(NamedTuple):
    """Numbers from first to last, linearly or logarithmically spaced; texts as written."""

    shape: str
    first: str
    last: str
    steps: str


class Drawn(NamedTuple):
    """A distribution for each number that the path matches; see `distribution` for the node."""

    node: Node


class Ranged(NamedTuple):
    """A uniform distribution between two numbers; texts as written."""

    least: str
    largest: str


class Linked(NamedTuple):
    """The value of another path, or a multiple of it."""

    path: str
    factor: str


Way: TypeAlias = Listed | Spaced | Drawn | Ranged | Linked


class Varied(NamedTuple):
    """A path with its line in the study file, and the variation of its value."""

    path: str
    line: int
    way: Way


class Ways(OwnKind):
    """A mapping from paths into robot or trajectory to variations of their values."""

    words = "mapping from paths to values"

    def read(self, node: Node, label: str, scope: Scope) -> Any:
        """Return a tuple of `Varied`."""
        if not isinstance(node, MapNode):
            return scope.unexpected(node, "a mapping from paths to values", label)
        found = []
        for path, entry in node.entries.items():
            try:
                check_path_of_change(path)
                found.append(Varied(path, node.key_lines[path], _variation(entry)))
            except InputError as error:
                message = error.problems[0].message
                scope.problems.add(entry.line, message if message.startswith(path) else f"{path}: {message}")
        return tuple(found) if len(found) == len(node.entries) else INVALID

    def schema(self, _refer: Refer) -> Schema:
        """See `OwnKind.schema`."""
        keys = (*SPACED, *SHAPES, LINKED)
        way = {"type": "object", "anyOf": [{"required": [key]} for key in keys]}
        return {"type": "object", "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, way]}}

    def json_value(self, content: Any, _of_record: Any) -> Any:
        """See `OwnKind.json_value`."""
        return {varied.path: str(varied.way) for varied in content}


def _variation(node: Node) -> Way:
    match node:
        case ListNode(items=items) if items:
            return Listed(tuple(map(plain, items)))
        case MapNode(entries=entries) if entries:
            return _mapped(node, dict(entries))
    raise InputError.one(f"expected {FORMS}, found {node}")


def _mapped(node: MapNode, entries: Mapping[str, Node]) -> Way:
    key = next(iter(entries))
    if LINKED in entries:
        texts = {
            word: _scalar_text(entry, word) for word, entry in entries.items() if word in (LINKED, FACTOR)
        }
        if len(texts) == len(entries):
            return Linked(texts[LINKED], texts.get(FACTOR, "1"))
    elif len(entries) == 1 and key in SPACED:
        return Spaced(key, *_scalar_texts(entries[key], 3, f"{key}: [first, last, count]"))
    elif len(entries) == 1 and key in SHAPES:
        if key == "uniform" and isinstance(entries[key], ListNode):
            return Ranged(*_scalar_texts(entries[key], 2, "uniform: [least, largest]"))
        return Drawn(node)
    hint = did_you_mean(key, [*SPACED, *SHAPES, LINKED]) if len(entries) == 1 else ""
    raise InputError.one(f"expected {FORMS}, found a mapping with {', '.join(entries)}{hint}")


def _scalar_texts(node: Node, count: int, form: str) -> list[str]:
    if not isinstance(node, ListNode) or len(node.items) != count:
        raise InputError.one(f"expected {form}, found {node}")
    return [_scalar_text(item, form) for item in node.items]


def _scalar_text(node: Node, form: str) -> str:
    if not isinstance(node, TextNode):
        raise InputError.one(f"expected a single value in {form}, found {node}")
    return node.text


STIFFNESS, TIMING = "stiffness", "timing"
MINIMIZED = ("torque", "energy", "copper_loss", "peak", TIME)
VARIED = (STIFFNESS, TIMING, "both")
"""Words of `vsacli optimize`, repeated here because importing the optimization is slow."""

_MARGIN = Check(
    lambda share: SINGULAR_MARGIN < share < 1,
    "above 0 and below 1",
    {"exclusiveMinimum": 0, "exclusiveMaximum": 1},
)
_SEED = Check(lambda number: number >= 0, "zero or more", {"minimum": 0})


@dataclass(frozen=True)
class Optimized(DeclaredRecord):
    """The optimization of each run, with the names and defaults of the options of `vsacli optimize`."""

    minimize: str = choice(
        MINIMIZED,
        "objective: rms of the motor torques, positive motor work, copper loss of the windings, "
        "peak motor torque, or duration",
        default="torque",
    )
    vary: str | None = choice(
        VARIED,
        "decision variables: stiffness profile, timing, or both; by default the stiffness, for "
        "time the timing",
        default=None,
    )
    min_margin: float = value(
        Share(),
        "minimum relative margin of every sample to the ends of its attainable stiffness range",
        check=_MARGIN,
        default=MIN_MARGIN,
    )
    seed: int = integer("seed of the random initial guesses", check=_SEED, default=0)

    @classmethod
    def example(cls, _variant: str) -> Mapping[str, Any]:
        """Return the values of a new study file."""
        return {"minimize": MINIMIZED[0]}

    def _problems(self) -> list[FieldProblem]:
        if (self.minimize, self.vary) == (TIME, STIFFNESS):
            return [FieldProblem(("vary",), "for the sake of time it is `timing` or `both` that varies")]
        return []

    @property
    def varied(self) -> str:
        """Varied quantities."""
        return self.vary or (TIMING if self.minimize == TIME else STIFFNESS)

    def optimum(self, robot: Robot, trajectory: Trajectory) -> Optimum:
        """Return the optimum of a run.

        Raises:
            InputError: the optimization does not apply to this robot and trajectory.
        """
        from vsacli.studies.search import optimize

        return optimize(
            robot, trajectory, self.minimize, self.varied, min_margin=self.min_margin, seed=self.seed
        )

    def costs_of(self, optimum: Optimum) -> list[FloatArray]:
        """Return the costs of a run before and after; NaN for joints without an optimum."""
        found = map(optimum.joints.get, optimum.robot.joint_names)
        each = list(found) if optimum.timing is None else [optimum.timing]
        return [
            np.array([np.nan if one is None else getattr(one, name) for one in each])
            for name in ("before", "after")
        ]

    @property
    def costs(self) -> tuple[Column, Column]:
        """Columns of the table for the costs."""
        dims, quantity, words = self._cost
        return (
            Column("cost_before", dims, quantity, f"{words} as commanded"),
            Column("cost_after", dims, quantity, f"{words} of the optimum"),
        )

    @property
    def _cost(self) -> tuple[tuple[str, ...], units.Quantity, str]:
        """Dimensions after `run`, unit and words of the minimized quantity."""
        if self.minimize == TIME:
            return (), units.TIME, "duration"
        from vsacli.studies.search.criteria import CRITERIA

        return JOINT, CRITERIA[self.minimize].quantity, CRITERIA[self.minimize].words


GRID = "grid"
METHODS = (GRID, "random", "latin_hypercube")

_COUNT = Check(lambda number: number >= 1, "1 or more", {"minimum": 1})


@dataclass(frozen=True)
class StudyFile(DeclaredRecord):
    """The content of a study file."""

    name: str = value(Name(), "name of the study")
    robot: str = text("path of the robot file, relative to the study file")
    trajectory: tuple[str, ...] = value(
        OneOrMore(Text()),
        "path of a trajectory file, relative to the study file; `*` matches any characters of its name",
    )
    vary: tuple[Varied, ...] = value(
        Ways(), "varied values, by the paths of `--set`; without it, only the trajectories vary", default=()
    )
    method: str = choice(
        METHODS,
        "sampling method: all combinations of the values, or a given number of random samples",
        default=GRID,
    )
    samples: int | None = integer(
        "number of random samples for each trajectory; absent if the method is grid",
        check=_COUNT,
        default=None,
    )
    seed: int = integer("seed of the random samples", check=_SEED, default=0)
    optimize: Optimized | None = value(
        RecordOf(Optimized),
        "optimization of each run; all kept values are then those of the optimum",
        default=None,
    )
    keep: tuple[str, ...] | None = value(
        Items(WordChoice(tuple(KEPT), words="name of a column")),
        "values that are kept of each run in addition to its verdict; all by default",
        default=None,
    )
    variables: tuple[str, ...] | None = value(
        Items(WordChoice(tuple(OVER_TIME), words="name of a variable")),
        "variables of results that are kept over time",
        default=None,
    )
    every: int = integer(
        "decimation factor of these variables: one of this many samples is kept", check=_COUNT, default=1
    )

    def _problems(self) -> Iterator[FieldProblem]:
        if self.method != GRID and self.samples is None:
            reason = f"the number of runs that the method {self.method} draws"
            yield FieldProblem((), f"missing key 'samples': {reason}")
        if self.method == GRID and self.samples is not None:
            reason = "the values of a grid determine the number of runs"
            yield FieldProblem(("samples",), f"{reason}; leave this key out")
        if self.method != GRID and not self.vary:
            yield FieldProblem((), f"missing key 'vary': the values that the method {self.method} draws")
