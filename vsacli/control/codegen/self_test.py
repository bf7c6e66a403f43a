"""Reference values for the self-test of generated code, and the check whether single precision passes it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, over_time
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.base.signals import DAMPING, POSITION
from vsacli.base.variables import Block
from vsacli.base.wrench import WrenchFrame
from vsacli.compute.tracing.single_precision import run_in_single_precision
from vsacli.control.codegen.interface import Array, Function
from vsacli.control.codegen.parameters import PARAMETERS, parameters_structure
from vsacli.control.codegen.robot_functions import wrench_argument
from vsacli.control.gains import STIFFNESS_ORDER
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.inverse import compute_block, internal_equilibrium
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter
from vsacli.trajectory.trajectory import Motion

CASES = 6
"""Number of samples; the last one requires half of the minimum attainable stiffness, so it is infeasible."""

SCALES = {"q": 1.0, "dq": 1.0, "ddq": 2.0, "d3q": 5.0, "d4q": 20.0, "dstiffness": 100.0, "ddstiffness": 500.0}
"""Half-widths of the ranges of random values, SI units; 1 for other signals."""

STATE_DEVIATION = {"q": 0.01, "dq": 0.1, "theta": 0.01, "dtheta": 0.1}
"""Largest deviations of the measured state from the command, SI units."""

POLE = -20.0

STEP_DURATION = 1e-3
"""Duration of a step, s."""

VARIATION, ZERO_VARIATION = 1.05, 0.01
"""Factor for varied parameters, and the value in place of zero: small, so that stiffness stays attainable."""

Arrays = dict[str, FloatArray]
"""Arrays, (cases, ...), by name."""


class ArrayComparison(NamedTuple):
    """The rule by which the self-test compares an array.

    Attributes:
        scale: value by which differences are divided; 0 if values must be equal, as flags must.
        bound: value to which larger ones are clipped.
    """

    scale: float
    bound: float


class ReferenceResults:
    """Inputs and results of the generated functions of a robot."""

    def __init__(
        self, robot: Robot, free_parameters: Sequence[Parameter] = (), wrench: WrenchFrame | None = None
    ) -> None:
        """Draw the inputs.

        Args:
            robot: robot of the functions.
            free_parameters: parameters that the functions have as an argument.
            wrench: frame of the wrench that they have as an argument; None without one.
        """
        self._robot = robot
        self._rng = np.random.default_rng(1)
        self._results: dict[str, Arrays] = {}
        command = self._draw_command()
        block = compute_block(robot, self._motion_of_cases(command, command["stiffness"]))
        self._inputs = {
            "motion": {name: command[name] for name in LinkTorques(robot).arguments.shapes},
            "command": command,
            "state": self._draw_state(block),
            "internal": self._draw_internal(command),
            "integral": {
                name: self._draw_uniform(scale) for name, scale in (("q", 1e-3), ("stiffness", 1.0))
            },
            **{
                name: {
                    array.name: self._rng.uniform(-1, 1, (CASES, *array.shape)) for array in structure.arrays
                }
                for name, structure in wrench_argument(robot, wrench)
            },
            PARAMETERS: _parameter_cases(free_parameters),
            "input": self._draw_plant_input(command, block.tau_motor),
            "dt": {"dt": np.full(CASES, STEP_DURATION)},
        }

    def inputs(self, function: Function) -> list[Arrays]:
        """Return the arguments of a function, each as arrays by name."""
        return [
            _gain_cases(structure.arrays[0].shape)
            if structure.name == "gains"
            else self._inputs[structure.name]
            for _, structure in function.arguments
        ]

    def results(self, function: Function) -> Arrays:
        """Return the results of a function for these inputs, as arrays by name."""
        if function.name not in self._results:
            with np.errstate(all="ignore"):  # one sample at a time, as on the controller
                cases = [
                    function.compute(list(entries[:, None])) for entries in self._input_entries(function)
                ]
            rows = [[np.asarray(row, dtype=np.float64).item() for row in case] for case in cases]
            self._results[function.name] = _result_arrays(function, np.array(rows).T)
        return self._results[function.name]

    def single_results(self, function: Function) -> Arrays:
        """Return the results of a function computed in single precision."""
        rows = run_in_single_precision(function.program, self._input_entries(function).T)
        return _result_arrays(function, np.array(rows, dtype=np.float64))

    def comparison(self, function: Function, name: str) -> ArrayComparison:
        """Return the rule by which the self-test compares an array of a function's results."""
        values = self.results(function)[name]
        largest = float(np.nanmax(self._inputs["command"]["stiffness"]))
        bound = BOUND * largest if name == BOUNDED else np.inf
        scale = float(np.abs(np.minimum(values, bound)[np.isfinite(values)]).max(initial=0.0))
        bits = next(array.bits for array in function.result.arrays if array.name == name)
        return ArrayComparison(0.0 if bits else scale, scale if name == BOUNDED else np.inf)

    def _input_entries(self, function: Function) -> FloatArray:
        """Return all entries of the arguments, (CASES, entries)."""
        entries = [
            arrays[member.name].reshape(CASES, -1)
            for (_, structure), arrays in zip(function.arguments, self.inputs(function), strict=True)
            for member in structure.arrays
        ]
        return np.concatenate(entries, axis=1)

    def _draw_uniform(self, scale: float) -> FloatArray:
        return self._rng.uniform(-scale, scale, (CASES, len(self._robot.joints)))

    def _draw_command(self) -> Arrays:
        signals = (POSITION, *self._robot.signals)
        names = [name for signal in signals for name in signal.names if name != "stiffness"]
        arrays = {name: self._draw_uniform(SCALES.get(name, 1.0)) for name in names}
        dampers = [joint.damper for joint in self._robot.joints]
        if any(dampers):
            low, high = np.array([damper.range if damper else (0.0, 0.0) for damper in dampers]).T
            arrays[DAMPING.key] = low + self._rng.uniform(0.2, 0.8, (CASES, len(dampers))) * (high - low)
        block = compute_block(self._robot, self._motion_of_cases(arrays, np.ones_like(arrays["q"])))
        lower = np.nan_to_num(block.stiffness_min)
        upper = np.minimum(np.nan_to_num(block.stiffness_max, nan=0.0), 4 * lower)
        stiffness = lower + self._rng.uniform(0.2, 0.8, lower.shape) * (upper - lower)
        stiffness[-1] = lower[-1] / 2
        return {**arrays, "stiffness": stiffness}

    def _motion_of_cases(self, arrays: Arrays, stiffness: FloatArray) -> Motion:
        return Motion.of(np.arange(float(CASES)), {**arrays, "stiffness": stiffness})

    def _draw_internal(self, command: Arrays) -> Arrays:
        """Return internal deflections away from those at which the springs alone carry the joints."""
        deflections = np.zeros((CASES, len(self._robot.joints), 2))
        motion = self._motion_of_cases(command, command["stiffness"])
        for index, internal_motion in internal_equilibrium(self._robot, motion).items():
            deflections[:, index] = 0.9 * np.nan_to_num(over_time(internal_motion.phi))
        return {"internal_phi": deflections}

    def _draw_plant_input(self, command: Arrays, tau_motor: FloatArray) -> Arrays:
        """Return motor torques away from those of the command, some of them beyond a largest torque."""
        torque = np.nan_to_num(tau_motor)
        torque_error = np.abs(torque).max() * self._rng.uniform(-1, 1, torque.shape)
        return {
            "tau_motor": torque + torque_error,
            **{name: command[name] for name in command.keys() & {DAMPING.key}},
        }

    def _draw_state(self, block: Block) -> Arrays:
        joint_arrays, motor_arrays = (
            {name: getattr(block, name) for name in names} for names in (("q", "dq"), ("theta", "dtheta"))
        )
        filled_motor_arrays = {
            name: np.where(np.isnan(values), block.q[..., None], values)
            for name, values in motor_arrays.items()
        }
        return {
            name: values + self._rng.uniform(-STATE_DEVIATION[name], STATE_DEVIATION[name], values.shape)
            for name, values in {**joint_arrays, **filled_motor_arrays}.items()
        }


def _parameter_cases(free_parameters: Sequence[Parameter]) -> Arrays:
    """Return nominal parameter values, and other valid ones in every second case."""
    nominal = np.array([parameter.value for parameter in free_parameters])
    varied = np.where(nominal == 0, ZERO_VARIATION, VARIATION * nominal)
    rows = np.where(np.arange(CASES) % 2, varied[:, None], nominal[:, None])
    return dict(zip(parameters_structure(free_parameters).entries, rows, strict=True))


def _gain_cases(shape: Sequence[int]) -> Arrays:
    """Return gains that place all poles at `POLE`, with integral action; the same for each case."""
    joints, order = shape
    position, stiffness = (np.poly([POLE] * (count + 1))[:0:-1] for count in (order, STIFFNESS_ORDER))
    return {
        "position": np.tile(position[1:], (CASES, joints, 1)),
        "stiffness": np.tile(stiffness[1:], (CASES, joints, 1)),
        "position_integral": np.full((CASES, joints), position[0]),
        "stiffness_integral": np.full((CASES, joints), stiffness[0]),
    }


def _result_arrays(function: Function, rows: FloatArray) -> Arrays:
    arrays = function.result.layout.arrays(rows)
    return {name: over_time(array) for name, array in arrays.items()}


TOLERANCE = {"double": 1e-9, "float": 2e-3}
"""Largest difference from NumPy, relative to the largest value of an array; rounding grows with the condition
number of the mass matrix, and near singularities."""

BOUNDED, BOUND = "stiffness_max", 100.0
"""Result that is compared only up to this multiple of the largest commanded stiffness: values beyond have no
effect on feasibility, and are inaccurate where a linkage is nearly stretched."""


SHARE = 0.5
"""Share of the self-test's tolerance beyond which single precision is refused: the math library of a
controller may round differently from this machine's. Bundled robots use a 400th of the tolerance."""


class _PrecisionDifference(NamedTuple):
    """A result that single precision changes.

    Attributes:
        size: difference relative to the largest value of the array; infinite if flags differ or if a value is
            missing in one precision.
        function: name of the function.
        array: array with the result.
        place: indices of the result in the array; the joint comes first.
        single: value in single precision.
        double: value in double precision.
    """

    size: float
    function: str
    array: Array
    place: tuple[int, ...]
    single: float
    double: float


def check_single_precision(robot: Robot, functions: Sequence[Function], reference: ReferenceResults) -> None:
    """Raise an error if a robot's functions in single precision would fail the self-test.

    Raises:
        InputError: differences are too large; names the joint and result with the largest one.
    """
    worst = max(
        _precision_differences(functions, reference), key=lambda difference: difference.size, default=None
    )
    allowed = SHARE * TOLERANCE["float"]
    if worst is None or worst.size <= allowed:
        return
    raise InputError.one(
        f"{robot.name} cannot be computed in single precision: at joint {robot.joint_names[worst.place[0]]}, "
        f"{_difference_text(worst)}; generate the code with --precision double"
    )


def _precision_differences(
    functions: Sequence[Function], reference: ReferenceResults
) -> Iterator[_PrecisionDifference]:
    for function in functions:
        single_results, double_results = reference.single_results(function), reference.results(function)
        for array in function.result.arrays:
            values = single_results[array.name], double_results[array.name]
            relative = _relative_differences(*values, reference.comparison(function, array.name))
            largest = np.unravel_index(relative.argmax(), relative.shape)
            _, *index = map(int, largest)
            yield _PrecisionDifference(
                float(relative[largest]),
                function.name,
                array,
                tuple(index),
                *(float(array_values[largest]) for array_values in values),
            )


def _relative_differences(single: FloatArray, double: FloatArray, comparison: ArrayComparison) -> FloatArray:
    """Return differences relative to the scale, computed as in the self-test."""
    clipped_single, clipped_double = (np.minimum(array, comparison.bound) for array in (single, double))
    equal = (clipped_single == clipped_double) | (np.isnan(clipped_single) & np.isnan(clipped_double))
    with np.errstate(all="ignore"):
        relative = np.abs(clipped_single - clipped_double) / comparison.scale
    return np.where(equal, 0.0, np.where(np.isnan(relative), np.inf, relative))


def _difference_text(difference: _PrecisionDifference) -> str:
    name = f"{difference.array.name} of {difference.function}"
    if difference.array.bits:
        return f"{name} are {_labels(difference.single)}, in double precision {_labels(difference.double)}"
    values = f"{name} is {difference.single:.4g}, in double precision {difference.double:.4g}"
    if np.isinf(difference.size):
        return values
    share_text, allowed_text = (
        f"{100 * share:.2g} %" for share in (difference.size, SHARE * TOLERANCE["float"])
    )
    return f"{values}, off by {share_text} of its largest value, where {allowed_text} may be lost"


def _labels(bits: float) -> str:
    return " and ".join(flag.label for flag in Flag if flag & int(bits)) or "none"
