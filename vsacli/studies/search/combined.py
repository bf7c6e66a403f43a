"""Search over slow-down, stiffness and branch together, for the combination of least cost.

The factor of the slow-down determines the link torques, and with these the attainable range and the limits of
a joint do not depend on the other joints. So the search is one-dimensional, over the factor; at each factor,
joints are fixed one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FLAG_TYPE, BoolArray, FloatArray, evenly
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.limits import limit_flags
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import ImpossibleError, admissible_stiffness
from vsacli.studies.search.loads import Instants, Load, TaskSamples, concatenate_task_samples
from vsacli.studies.search.path_commands import PathCommands, Speeds
from vsacli.studies.search.scans import FACTORS_AT_ONCE, FIRST_STEPS, LARGEST_FACTOR, WATCHED_STEPS, Factors
from vsacli.studies.search.task import Combination, Form, Task, branch_path, constant_change

STRIDES = ((1.3, 0.01), (3.0, 0.02), (30.0, 0.05), (LARGEST_FACTOR, 0.2))
"""Pairs of a factor and the relative stride of the scan up to it: fine strides for small slow-downs."""

BOUNDING_STEPS = 40
"""Samples from which the lower bounds of costs follow."""

MOST_ROUNDS = 20
"""Limit on rounds that add samples refusing a change that watched ones accept; two or three are usual."""

SAME_CORRIDOR = 1e-6
"""Relative difference up to which the ends of attainable ranges are equal but for rounding."""

BRANCH_GAIN = 0.9
"""Share of a joint's cost below which the other branch must bring it to be preferred."""


class CombinedSearch:
    """A search for the combination of changes that fixes a motion.

    Some samples are watched; others that refuse a result join them. Results are cached by factor.

    Args:
        task: motion to fix, acceptance rule, and cost.
        form: search for the stiffness change of a joint.
        branches: whether joints may change to the other branch.
    """

    def __init__(self, task: Task, form: Form = constant_change, *, branches: bool = False) -> None:
        self.task, self.form = task, form
        watched = task.acceptance.watched(task.trajectory, WATCHED_STEPS)
        self._choices = _branch_variants(task.acceptance.robot, watched if branches else None)
        self._factors = Factors.of(task.trajectory)
        self._watch(watched)
        self._impossible = task.impossible.setdefault((form, branches), set())
        self._impossible_paths = task.impossible.setdefault(None, set())

    @property
    def exchangeable(self) -> bool:
        """Whether the other branch of some joint makes a difference."""
        return any(len(choices) > 1 for choices in self._choices)

    def smallest(self) -> Combination | None:
        """Return the combination of least cost, confirmed at all samples if its changes are constants."""
        return self._confirmed(self._smallest)

    def fastest(self) -> Combination | None:
        """Return the combination with the least slow-down, confirmed in the same way."""
        return self._confirmed(self._fastest)

    def possible(self) -> bool:
        """Return whether there is any combination, confirmed in the same way."""
        return self._confirmed(self._first) is not None

    def _confirmed(self, choose: Callable[[], Combination | None]) -> Combination | None:
        # limits allow for the noise of a recording, which the quick test in `_ruled_out` does not know
        if not self._impossible and not self.task.trajectory.estimates:
            self._impossible |= self._ruled_out()
        for _ in range(MOST_ROUNDS):
            found = choose()
            refused = None if found is None or self.form is not constant_change else self._refused(found)
            if refused is None:
                return found
            self._watch(concatenate_task_samples([self._watched, refused]))
        return None

    def _watch(self, part: TaskSamples) -> None:
        """Watch these samples from now on, and discard results that were found for others."""
        self._watched, self._path = part, PathCommands(self.task.acceptance.robot, part.motion)
        self._found: dict[int, Combination] = {}

    def _refused(self, found: Combination) -> TaskSamples | None:
        """Return samples that refuse constant changes, from the first block with any, as commanded."""
        acceptance = self.task.acceptance_with(found)
        change = np.zeros(self.task.trajectory.joints)
        change[list(found.constants)] = list(found.constants.values())
        for part in acceptance.parts(self.task.trajectory.stretched(found.factor), found.factor):
            steps = np.flatnonzero(np.any(acceptance.refused(part.stiffened(change)), axis=1))
            if steps.size:
                return part.select(steps[evenly(len(steps), WATCHED_STEPS)]).slowed(1 / found.factor)
        return None

    def _first(self) -> Combination | None:
        """Return the first combination that is found, in the order of `_smallest`."""
        bounds = self._lower_bounds()
        numbers = sorted(bounds, key=lambda each: (bounds[each], each))
        return next((found for number in numbers if (found := self._at(number)) is not None), None)

    def _fastest(self) -> Combination | None:
        """Return the combination with the smallest factor found by scan and bisection."""
        refused = self._factors.first - 1
        for number in self._scanned():
            if self._at(number) is not None:
                break
            refused = number
        else:
            return None
        while number - refused > 1:
            middle = (number + refused) // 2
            number, refused = (number, middle) if self._at(middle) is None else (middle, refused)
        return self._at(number)

    def _smallest(self) -> Combination | None:
        """Return the combination of least cost, by a scan and then ever shorter steps to either side.

        The scan takes factors in the order of a lower bound of their cost, until that exceeds the best cost.
        """
        best, at, cost = None, 0, self.task.cost
        bounds = self._lower_bounds()
        for number in sorted(bounds, key=lambda each: (bounds[each], each)):
            if best is not None and bounds[number] >= best.size:
                break
            found = self._at(number, math.inf if best is None else best.size)
            if found is not None and (best is None or (found.size, number) < (best.size, at)):
                best, at = found, number
        if best is None:
            return None
        step = self._stride(at)
        within = range(self._factors.first, self._factors.last + 1)
        while step:
            sides = {
                side: self._at(side, best.size)
                for side in (at - step, at + step)
                if side in within and cost.of_factor(self._factors.factor(side)) < best.size
            }
            found, side = min(
                ((each, side) for side, each in sides.items() if each is not None),
                key=lambda pair: pair[0].size,
                default=(best, at),
            )
            if found.size < best.size:
                best, at = found, side
            else:
                step //= 2
        return best

    def _at(self, number: int, below: float = math.inf) -> Combination | None:
        """Return the combination that fixes every joint at the factor of a number; None if there is none.

        None may also mean that its cost is not below a limit.
        """
        if number in self._impossible or number in self._impossible_paths:
            return None
        if number not in self._found:
            try:
                found = self._fixed(self._factors.factor(number), below)
            except ImpossibleError:
                self._impossible.add(number)
                return None
            if found is None:
                return None
            self._found[number] = found
        return self._found[number]

    def _lower_bounds(self) -> dict[int, float]:
        """Return a lower bound of the cost at each scanned factor that is not known to be impossible.

        The bound of the constants is that of a few samples at all factors at once.
        """
        self._rule_out_paths()
        ruled_out = self._impossible | self._impossible_paths
        numbers = [number for number in self._scanned() if number not in ruled_out]
        least = [self.task.cost.of_factor(self._factors.factor(number)) for number in numbers]
        # limits allow for the noise of a recording, which the admissible range does not know
        if self.form is constant_change and not self.task.trajectory.estimates and numbers:
            few = self._watched.select(evenly(len(self._watched.factor), BOUNDING_STEPS))
            part = concatenate_task_samples(few.slowed(self._factors.factor(each)) for each in numbers)
            of_joints = self._least_of_joints(part.loads(self.task.acceptance.robot), len(numbers))
            least = [math.hypot(own, *of_joint) for own, of_joint in zip(least, of_joints.T, strict=True)]
        return {number: bound for number, bound in zip(numbers, least, strict=True) if bound < math.inf}

    def _least_of_joints(self, loads: Sequence[Load], factors: int) -> FloatArray:
        """Return a lower bound of the cost of the constant of each joint, (joints, factors); 0 if unknown."""
        acceptance, least = self.task.acceptance, np.zeros((len(loads), factors))
        for index, (choices, load) in enumerate(zip(self._choices, loads, strict=True)):
            joint = choices[""]
            if index in acceptance.ignored or len(choices) > 1 or STIFFNESS.key not in joint.commanded:
                continue
            asked = self._watched.motion.commanded[STIFFNESS.key][:, index]
            for place, offset in enumerate(_least_offsets(joint, load, acceptance.min_margin, factors)):
                if offset:
                    size = math.inf
                    if offset < math.inf:
                        size = self.task.cost.of_stiffness(asked, np.full(len(asked), offset))
                    least[index, place] = (1 - SAME_CORRIDOR) * size
        return least

    def _ruled_out(self) -> set[int]:
        """Return numbers of scanned factors at which a few samples already exclude every stiffness.

        Many factors are evaluated in one call, which costs hardly more than a single one.
        """
        few = self._watched.select(evenly(len(self._watched.factor), FIRST_STEPS))
        numbers, found = list(self._scanned()), set[int]()
        for start in range(0, len(numbers), FACTORS_AT_ONCE):
            tried = numbers[start : start + FACTORS_AT_ONCE]
            impossible = self._refusing(
                concatenate_task_samples(few.slowed(self._factors.factor(each)) for each in tried)
            )
            of_factors = impossible.reshape(len(tried), -1).any(axis=1)
            found.update(tried[index] for index in np.flatnonzero(of_factors).tolist())
            if not of_factors.all():
                break
        return found

    def _refusing(self, part: TaskSamples) -> BoolArray:
        """Return a mask of the samples at which some joint is refused at any stiffness, (samples,)."""
        acceptance = self.task.acceptance
        impossible = np.zeros(len(part.factor), dtype=np.bool_)
        loads = part.loads(acceptance.robot)
        for index, (choices, load) in enumerate(zip(self._choices, loads, strict=True)):
            joint = choices[""]
            if index in acceptance.ignored:
                continue
            path = {"q": load.command.q, "dq": load.command.dq}
            impossible |= limit_flags(joint, path, np.zeros(len(impossible), dtype=FLAG_TYPE)) != 0
            if STIFFNESS.key not in joint.actuator.commanded:
                impossible |= acceptance.refused_steps(joint, load)
            elif len(choices) == 1:
                low, high = admissible_stiffness(joint, load.command, acceptance.min_margin)
                impossible |= np.isnan(low) | (low > (1 + SAME_CORRIDOR) * high)
        return impossible

    def _loads(self, factor: float) -> list[Load]:
        """Return the load of each joint at the watched samples, slowed down by a factor.

        Raises:
            ImpossibleError: a joint exceeds a limit of position or velocity.
        """
        watched, acceptance = self._watched, self.task.acceptance
        instants = Instants(watched.motion.time, watched.factor * factor)
        commands = self._path.at(Speeds.even(factor, len(instants.time)))
        loads = [Load(instants.time, command, instants) for command in commands]
        for index, (choices, load) in enumerate(zip(self._choices, loads, strict=True)):
            if index not in acceptance.ignored and (reason := acceptance.path_reason(choices[""], load)):
                raise ImpossibleError(reason)
        return loads

    def _rule_out_paths(self) -> None:
        """Note the scanned factors at which the path is too fast; faster ones than such a factor are, too."""
        numbers = [number for number in self._scanned() if number not in self._impossible_paths]
        refused, accepted = -1, len(numbers)
        middle = 0  # mostly, no factor is refused
        while accepted - refused > 1:
            try:
                self._loads(self._factors.factor(numbers[middle]))
                accepted = middle
            except ImpossibleError:
                refused = middle
            middle = (accepted + refused) // 2
        self._impossible_paths |= set(numbers[: refused + 1])

    def _fixed(self, factor: float, below: float) -> Combination | None:
        """Return the changes of all joints at a factor, or None if their cost is not below a limit.

        Raises:
            ImpossibleError: some joint is refused at any stiffness.
        """
        joints = list(enumerate(zip(self._choices, self._loads(factor), strict=True)))
        sizes, found = [self.task.cost.of_factor(factor)], []
        for index, (choices, load) in joints:
            found.append(self._of_joint(index, choices, load))
            sizes.append(found[-1][0])
            if math.hypot(*sizes) > below:
                return None
        return Combination(
            factor,
            changes={index: change for index, (_, _, change) in enumerate(found) if change.any()},
            branches={index: branch for index, (_, branch, _) in enumerate(found) if branch},
            size=math.hypot(*sizes),
        )

    def _of_joint(self, index: int, choices: dict[str, Joint], load: Load) -> tuple[float, str, FloatArray]:
        """Return cost, branch ("" if unchanged) and change of stiffness of one joint."""
        if index in self.task.acceptance.ignored:
            return 0.0, "", np.zeros(len(load.time))
        asked, best, reason = load.command.commanded["stiffness"], None, ImpossibleError()
        for branch, joint in choices.items():
            try:
                change = self._change(joint, load)
            except ImpossibleError as error:
                reason = error
                continue
            size = self.task.cost.of_stiffness(asked, change) if change.any() else 0.0
            if best is None or size < BRANCH_GAIN * best[0]:
                best = size, branch, change
            if not size:
                break
        if best is None:
            raise reason
        return best

    def _change(self, joint: Joint, load: Load) -> FloatArray:
        acceptance = self.task.acceptance
        if not acceptance.refused_steps(joint, load).any():
            return np.zeros(len(load.time))
        return self.form(acceptance, joint, load)

    def _scanned(self) -> Iterator[int]:
        """Yield the numbers of the scanned factors."""
        number = self._factors.first
        while number < self._factors.last:
            yield number
            number += self._stride(number)
        yield self._factors.last

    def _stride(self, number: int) -> int:
        factor = self._factors.factor(number)
        share = next(share for limit, share in STRIDES if factor <= limit)
        return math.ceil(number * share)


def _least_offsets(joint: Joint, load: Load, min_margin: float, parts: int) -> FloatArray:
    """Return the size of the least constant that every sample of a part of a load requires, (parts,).

    Margin, stiffness limits and deflection limits count; infinite if no stiffness keeps them.
    """
    low, high = admissible_stiffness(joint, load.command, min_margin)
    asked = load.command.commanded[STIFFNESS.key]
    rise = np.max((low - asked).reshape(parts, -1), axis=1)
    fall = np.min((high - asked).reshape(parts, -1), axis=1)
    impossible = np.isnan(rise) | np.isnan(fall) | (rise > fall + SAME_CORRIDOR * np.abs(asked).max())
    return np.where(impossible, np.inf, np.maximum(np.maximum(rise, -fall), 0.0))


def _branch_variants(robot: Robot, watched: TaskSamples | None) -> list[dict[str, Joint]]:
    """Return the variants of each joint by branch; the key "" is the unchanged joint.

    Args:
        robot: robot with the joints.
        watched: samples at which the other branch must make a difference to be a variant; None for no
            other branch.
    """
    choices = [{"": joint} for joint in robot.joints]
    if watched is None:
        return choices
    for index, (joint, load) in enumerate(zip(robot.joints, watched.loads(robot), strict=True)):
        branch = joint.actuator.opposite_branch
        if branch is not None:
            exchanged = robot.replace(branch_path(robot, index), branch).joints[index]
            if not _alike(joint.actuator, exchanged.actuator, load.command):
                choices[index][branch] = exchanged
    return choices


def _alike(one: Actuator, other: Actuator, command: Command) -> bool:
    """Return whether the branches of an actuator are mirror images, as those of equal springs are."""
    if len(set(one.motors)) > 1 or len(set(one.max_deflections)) > 1:
        return False
    asked = command.tau_e, command.commanded["stiffness"], command.q
    first, second = one.solve(*asked), other.solve(*asked)
    pairs = (first.lower, second.lower), (first.upper, second.upper)
    return all(np.allclose(here, there, rtol=SAME_CORRIDOR, equal_nan=True) for here, there in pairs)
