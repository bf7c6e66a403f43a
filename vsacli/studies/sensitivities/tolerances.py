"""How uncertain the numbers of a robot are: one share for all, or a file that says it of each."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.documents import tree
from vsacli.documents.expression import ExpressionError
from vsacli.documents.fields import LARGEST
from vsacli.documents.kinds.shares import PER_CENT
from vsacli.documents.number import evaluate
from vsacli.documents.source import Problems, read_source
from vsacli.documents.yaml_tree import parse_yaml
from vsacli.robot.parameters import Parameter
from vsacli.studies.sensitivities.parameter_steps import SMALL_CHANGES

FORM = "e.g. {normal: 5 %} or {uniform: 0.001}"
_PLAIN = re.compile(r"[-+.\d]+(e[-+]?\d+)?|nan|inf", re.IGNORECASE)


class Tolerance(NamedTuple):
    """How a number is distributed about its value.

    Attributes:
        shape: `normal`, or `uniform`.
        size: standard deviation of the one, half width of the other; SI units.
    """

    shape: str
    size: float

    @property
    def deviation(self) -> float:
        """Its standard deviation."""
        return self.size if self.shape == "normal" else self.size / math.sqrt(3)

    def drawn(self, random: np.random.Generator) -> float:
        """A deviation from the value."""
        if self.shape == "normal":
            return float(random.normal(0.0, self.size))
        return float(random.uniform(-self.size, self.size))

    def below(self, share: float) -> float:
        """The deviation that so large a share of all is below: the quantile."""
        if self.shape == "normal":
            from scipy.special import ndtri

            return self.size * float(ndtri(share))
        return self.size * (2 * share - 1)


SHAPES = ("normal", "uniform")


def tolerances_of(text: str, chosen: Sequence[Parameter]) -> tuple[Tolerance | None, ...]:
    """The tolerance of each parameter; None for what is exact.

    Args:
        text: a share such as `5 %`, or the path of a YAML file of paths into the robot, each with a
            distribution; `*` in a path stands for anything, and of several that fit the last one counts.
        chosen: the parameters. A share is of numbers that can be compared by one: not of angles and of
            lengths of links, which are zero as often as not.

    Raises:
        InputError: with file and line of what is no distribution, or fits no parameter.
    """
    share = PER_CENT.fullmatch(text.strip())
    if share is None:
        if _PLAIN.fullmatch(text.strip()):
            raise InputError.one(
                f"a tolerance of all numbers is a share, {text.strip()} % or another, or a file"
            )
        return _from_file(text, chosen)
    size = _number(share["number"], text) / 100
    exact = [each.quantity in SMALL_CHANGES or each.value == 0 for each in chosen]
    return tuple(
        None if known else Tolerance("normal", size * abs(each.value))
        for each, known in zip(chosen, exact, strict=True)
    )


def deviations(tolerances: Sequence[Tolerance | None]) -> FloatArray:
    """Standard deviation of each parameter, zero for what is exact."""
    return np.array([0.0 if each is None else each.deviation for each in tolerances])


def _from_file(path: str | os.PathLike[str], chosen: Sequence[Parameter]) -> tuple[Tolerance | None, ...]:
    source, text = read_source(path)
    problems = Problems(source.path)
    root = parse_yaml(text, problems)
    if not isinstance(root, tree.Mapping):
        problems.fail(root.line, f"expected paths of numbers, each with a distribution, {FORM}, found {root}")
    found: list[Tolerance | None] = [None] * len(chosen)
    for pattern, node in root.entries.items():
        line = root.key_lines[pattern]
        fitting = [place for place, each in enumerate(chosen) if fnmatchcase(str(each), pattern)]
        if not fitting:
            hint = did_you_mean(pattern, [str(each) for each in chosen])
            problems.add(line, f"no number of the robot fits {pattern!r}{hint}")
        for place in fitting:
            try:
                found[place] = distribution(node, chosen[place].value, chosen[place].unit)
            except InputError as error:
                problems.add(node.line, f"{pattern}: {error}")
                break
    problems.check()
    return tuple(found)


def distribution(node: tree.Node, value: float, unit: str) -> Tolerance:
    """The tolerance that a file says of a number.

    Args:
        node: such as `{normal: 5 %}`.
        value: the number.
        unit: of it.

    Raises:
        InputError: it is none.
    """
    if not isinstance(node, tree.Mapping) or len(node.entries) != 1:
        raise InputError.one(f"expected a distribution, {FORM}, found {node}")
    ((shape, size),) = node.entries.items()
    if shape not in SHAPES or not isinstance(size, tree.Scalar):
        raise InputError.one(f"expected a distribution, {FORM}, found {shape}: {size}")
    share = PER_CENT.fullmatch(size.text)
    if share is None:
        return Tolerance(shape, _number(size.text, size.text, unit))
    return Tolerance(shape, _number(share["number"], size.text) / 100 * abs(value))


def _number(text: str, whole: str, unit: str = "") -> float:
    try:
        number: float = evaluate(text, unit)
    except ExpressionError as error:
        raise InputError.one(f"{whole!r} is no tolerance: {error}") from None
    if not number > 0:
        raise InputError.one(f"a tolerance must be positive, not {whole!r}")
    if number > LARGEST:
        raise InputError.one(f"a tolerance must be at most {LARGEST:g}, not {whole!r}")
    return number
