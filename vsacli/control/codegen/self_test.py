"""The self-test of generated code: reference values, and refusal of a precision in which it would fail."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, over_time
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.base.signals import DAMPING, POSITION
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES
from vsacli.compute.tracing.single_precision import in_single_precision
from vsacli.control.codegen.interface import Array, Function
from vsacli.control.codegen.parameters import PARAMETERS, parameters_structure
from vsacli.control.gains import STIFFNESS_ORDER
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import compute_block, internal_equilibrium
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.trajectory.motion import Motion

CASES = 6
"""Samples; the last one asks for half of the smallest stiffness that can be reached."""

SCALES = {"q": 1.0, "dq": 1.0, "ddq": 2.0, "d3q": 5.0, "d4q": 20.0, "dstiffness": 100.0, "ddstiffness": 500.0}
"""Half-widths of the drawn values, SI units; 1 for further signals."""

MISSED = {"q": 0.01, "dq": 0.1, "theta": 0.01, "dtheta": 0.1}
"""Differences of the measured state from the command."""

POLE = -20.0

VARIED, UNLIKE_ZERO = 1.05, 0.01
"""Factor of numbers that are parameters, and what stands for zero: small, so that stiffness is reachable."""

Arrays = dict[str, FloatArray]
"""Arrays (cases, ...) by name."""


class Comparison(NamedTuple):
    """The comparison of an array in the self-test.

    Attributes:
        scale: of relative differences; 0 if there may be none, as of flags.
        bound: values beyond count as this one.
    """

    scale: float
    bound: float


class Reference:
    """Inputs and results of the generated functions of a robot."""

    def __init__(self, robot: Robot, chosen: Sequence[Parameter] = ()) -> None:
        """Take functions with the chosen parameters as an argument, if there are any."""
        self._robot = robot
        self._rng = np.random.default_rng(1)
        self._results: dict[str, Arrays] = {}
        command = self._command()
        self._inputs = {
            "motion": {name: command[name] for name in LinkTorques(robot).arguments.shapes},
            "command": command,
            "state": self._state(command),
            "internal": self._internal(command),
            "integral": {name: self._drawn(scale) for name, scale in (("q", 1e-3), ("stiffness", 1.0))},
            "wrench": {name: self._rng.uniform(-1, 1, (CASES, len(WRENCH_AXES))) for name in WRENCH_NAMES},
            PARAMETERS: _two_sets(chosen),
        }

    def inputs(self, function: Function) -> list[Arrays]:
        """Return the arguments of a function, each by the names of its arrays."""
        return [
            _gains(structure.arrays[0].shape) if structure.name == "gains" else self._inputs[structure.name]
            for _, structure in function.arguments
        ]

    def results(self, function: Function) -> Arrays:
        """Return the results of a function for these inputs, by the names of the arrays of its result."""
        if function.name not in self._results:
            with np.errstate(all="ignore"):  # one sample at a time, as on the controller
                cases = [function.compute(list(entries[:, None])) for entries in self._entries(function)]
            rows = [[np.asarray(row, dtype=np.float64).item() for row in case] for case in cases]
            self._results[function.name] = _result_arrays(function, np.array(rows).T)
        return self._results[function.name]

    def single_results(self, function: Function) -> Arrays:
        """Return the results that code in single precision has."""
        rows = in_single_precision(function.program, self._entries(function).T)
        return _result_arrays(function, np.array(rows, dtype=np.float64))

    def comparison(self, function: Function, name: str) -> Comparison:
        """Return the rule by which the self-test compares an array of the results of a function."""
        values = self.results(function)[name]
        bound = BOUND * self._largest_stiffness if name == BOUNDED else np.inf
        scale = float(np.abs(np.minimum(values, bound)[np.isfinite(values)]).max(initial=0.0))
        bits = next(array.bits for array in function.result.arrays if array.name == name)
        return Comparison(0.0 if bits else scale, scale if name == BOUNDED else np.inf)

    def _entries(self, function: Function) -> FloatArray:
        """Return all entries of the arguments, (CASES, entries)."""
        entries = [
            arrays[member.name].reshape(CASES, -1)
            for (_, structure), arrays in zip(function.arguments, self.inputs(function), strict=True)
            for member in structure.arrays
        ]
        return np.concatenate(entries, axis=1)

    @property
    def _largest_stiffness(self) -> float:
        """Largest stiffness demanded, of joints of either kind."""
        return float(np.nanmax(self._inputs["command"]["stiffness"]))

    def _drawn(self, scale: float) -> FloatArray:
        return self._rng.uniform(-scale, scale, (CASES, len(self._robot.joints)))

    def _command(self) -> Arrays:
        signals = (POSITION, *self._robot.signals)
        names = [name for signal in signals for name in signal.names if name != "stiffness"]
        drawn = {name: self._drawn(SCALES.get(name, 1.0)) for name in names}
        dampers = [joint.damper for joint in self._robot.joints]
        if any(dampers):
            low, high = np.array([damper.range if damper else (0.0, 0.0) for damper in dampers]).T
            drawn[DAMPING.key] = low + self._rng.uniform(0.2, 0.8, (CASES, len(dampers))) * (high - low)
        block = compute_block(self._robot, self._motion(drawn, np.ones_like(drawn["q"])))
        lower = np.nan_to_num(block.stiffness_min)
        upper = np.minimum(np.nan_to_num(block.stiffness_max, nan=0.0), 4 * lower)
        stiffness = lower + self._rng.uniform(0.2, 0.8, lower.shape) * (upper - lower)
        stiffness[-1] = lower[-1] / 2
        return {**drawn, "stiffness": stiffness}

    def _motion(self, arrays: Arrays, stiffness: FloatArray) -> Motion:
        return Motion.of(np.arange(float(CASES)), {**arrays, "stiffness": stiffness})

    def _internal(self, command: Arrays) -> Arrays:
        """Away from where the springs carry the joints alone."""
        deflections = np.zeros((CASES, len(self._robot.joints), 2))
        motion = self._motion(command, command["stiffness"])
        for index, inside in internal_equilibrium(self._robot, motion).items():
            deflections[:, index] = 0.9 * np.nan_to_num(over_time(inside.phi))
        return {"internal_phi": deflections}

    def _state(self, command: Arrays) -> Arrays:
        block = compute_block(self._robot, self._motion(command, command["stiffness"]))
        of_joint, of_motor = (
            {name: getattr(block, name) for name in names} for names in (("q", "dq"), ("theta", "dtheta"))
        )
        at_rest = {
            name: np.where(np.isnan(values), block.q[..., None], values) for name, values in of_motor.items()
        }
        return {
            name: values + self._rng.uniform(-MISSED[name], MISSED[name], values.shape)
            for name, values in {**of_joint, **at_rest}.items()
        }


def _two_sets(chosen: Sequence[Parameter]) -> Arrays:
    """Nominal values, and in every other case others that are allowed as well."""
    nominal = np.array([each.value for each in chosen])
    other = np.where(nominal == 0, UNLIKE_ZERO, VARIED * nominal)
    of_cases = np.where(np.arange(CASES) % 2, other[:, None], nominal[:, None])
    return dict(zip(parameters_structure(chosen).entries, of_cases, strict=True))


def _gains(shape: Sequence[int]) -> Arrays:
    """Return all poles at one place, with integral action; the same for each case."""
    joints, order = shape
    position, stiffness = (np.poly([POLE] * (count + 1))[:0:-1] for count in (order, STIFFNESS_ORDER))
    return {
        "position": np.tile(position[1:], (CASES, joints, 1)),
        "stiffness": np.tile(stiffness[1:], (CASES, joints, 1)),
        "position_integral": np.full((CASES, joints), position[0]),
        "stiffness_integral": np.full((CASES, joints), stiffness[0]),
    }


def _result_arrays(function: Function, rows: FloatArray) -> Arrays:
    found = function.result.layout.arrays(rows)
    return {name: over_time(array) for name, array in found.items()}


TOLERANCE = {"double": 1e-9, "float": 2e-3}
"""Largest difference from NumPy, relative to the largest value of an array; rounding grows with the condition
of the mass matrix, and towards singularities."""

BOUNDED, BOUND = "stiffness_max", 100.0
"""A result that is compared up to this many times the largest stiffness demanded: what lies beyond decides
nothing, and where a linkage is stretched it is as inaccurate as its geometry makes it."""


SHARE = 0.5
"""Part of the self-test's tolerance beyond which single precision is refused: the library of a controller may
round functions otherwise than this machine, and bundled robots take a 400th of the tolerance."""


class _Difference(NamedTuple):
    """A result that single precision changes.

    Attributes:
        size: difference relative to the largest value of the array; infinite if flags differ or a value is
            missing in one precision.
        function: name of the function.
        array: the array.
        place: indices of the result in it; the joint comes first.
        single: value in single precision.
        double: value in double precision.
    """

    size: float
    function: str
    array: Array
    place: tuple[int, ...]
    single: float
    double: float


def check_single_precision(robot: Robot, functions: Sequence[Function], reference: Reference) -> None:
    """Refuse a robot whose functions in single precision miss the values of the self-test.

    Raises:
        InputError: naming the joint and the result that are furthest off.
    """
    worst = max(_differences(functions, reference), key=lambda each: each.size, default=None)
    allowed = SHARE * TOLERANCE["float"]
    if worst is None or worst.size <= allowed:
        return
    raise InputError.one(
        f"{robot.name} cannot be computed in single precision: at joint {robot.joint_names[worst.place[0]]}, "
        f"{_described(worst)}; generate the code with --precision double"
    )


def _differences(functions: Sequence[Function], reference: Reference) -> Iterator[_Difference]:
    """Yield the largest difference in each array."""
    for function in functions:
        single, double = reference.single_results(function), reference.results(function)
        for array in function.result.arrays:
            values = single[array.name], double[array.name]
            sizes = _sizes(*values, reference.comparison(function, array.name))
            at = np.unravel_index(sizes.argmax(), sizes.shape)
            _, *index = map(int, at)
            yield _Difference(
                float(sizes[at]), function.name, array, tuple(index), *(float(each[at]) for each in values)
            )


def _sizes(single: FloatArray, double: FloatArray, comparison: Comparison) -> FloatArray:
    """Differences as the self-test sees them, relative to the scale."""
    found, expected = (np.minimum(each, comparison.bound) for each in (single, double))
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    with np.errstate(all="ignore"):
        sizes = np.abs(found - expected) / comparison.scale
    return np.where(same, 0.0, np.where(np.isnan(sizes), np.inf, sizes))


def _described(difference: _Difference) -> str:
    name = f"{difference.array.name} of {difference.function}"
    if difference.array.bits:
        return f"{name} are {_flags(difference.single)}, in double precision {_flags(difference.double)}"
    values = f"{name} is {difference.single:.4g}, in double precision {difference.double:.4g}"
    if np.isinf(difference.size):
        return values
    size, allowed = (f"{100 * each:.2g} %" for each in (difference.size, SHARE * TOLERANCE["float"]))
    return f"{values}, off by {size} of its largest value, where {allowed} may be lost"


def _flags(bits: float) -> str:
    return " and ".join(flag.label for flag in Flag if flag & int(bits)) or "none"
