"""The constraints of every search: margin and limits at each sample, judged exactly as a run judges them.

`Acceptance` is the rule. `admissible_stiffness` is the range that margin, stiffness limits and deflection
limits leave to a joint. `verify` confirms a motion by a run, and on a grid between its samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.reach import VariablesOfJoint, margin
from vsacli.actuators.transmission import Command
from vsacli.analysis.batch import Batch
from vsacli.analysis.joint_report import JointReport
from vsacli.analysis.report import Report
from vsacli.analysis.variant_groups import PreparedRun
from vsacli.base import units
from vsacli.base.arrays import FLAG_TYPE, BoolArray, FlagArray, FloatArray, evenly
from vsacli.base.errors import VsacliError
from vsacli.base.flags import LIMITS, Flag, has_flag
from vsacli.dynamics.drive import drive
from vsacli.dynamics.inverse import compute_block, usual_block
from vsacli.dynamics.limits import MARGIN, Finding, limit_checks, limit_flags, worst_excess
from vsacli.dynamics.variants import Variants
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.search.fix_report import Fix
from vsacli.studies.search.loads import (
    Instants,
    Load,
    TaskSamples,
    concatenate_task_samples,
    evenly_spaced_samples,
)
from vsacli.studies.search.recorded_limits import RecordedLimits
from vsacli.trajectory.trajectory import Trajectory

RESERVED = ("dq", "dtheta", "tau_motor", "current", "voltage")
"""Variables that can exceed a limit between samples that keep it, and that a search can keep away from it."""


STRICTER = (0.0, 0.0, 0.0, 1e-6, 1e-4, 0.01)
"""Relative tightening of the rule in successive searches. A result that is accepted at its samples can be
refused between them; the refused instants count in the next search, so that two searches usually suffice."""

REST_SAMPLES = 1000
"""Number of samples at which it is seen whether a motion is refused even at rest."""

_Found = TypeVar("_Found")


class ImpossibleError(VsacliError):
    """Error: no change of a kind fixes a motion.

    Attributes:
        reasons: reasons as clauses, one for each joint that cannot be fixed.
    """

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


@dataclass(frozen=True)
class Acceptance:
    """The rule by which samples are accepted: a margin of at least `min_margin`, and every limit kept.

    Attributes:
        robot: robot that executes the samples.
        min_margin: required margin.
        recorded: allowance for the noise of a recorded task.
        reserve: required clearance to the limits of `RESERVED`, as a share of each limit.
        ignored: indices of joints that do not count.
        between: instants between samples that count as well, as times since the start of the unchanged
            task, s.
    """

    robot: Robot
    min_margin: float
    recorded: RecordedLimits | None = None
    reserve: float = 0.0
    ignored: frozenset[int] = frozenset()
    between: FloatArray = field(default_factory=lambda: np.empty(0), compare=False)

    def stricter(self, share: float) -> Acceptance:
        """Return the rule with a margin that is larger by a share, and with this share as the reserve."""
        return replace(self, min_margin=(1 + share) * self.min_margin, reserve=share)

    def confirmed(
        self, attempt: Callable[[Acceptance], tuple[_Found, FloatArray | None]]
    ) -> tuple[_Found, bool]:
        """Search with ever stricter rules until a run confirms the result; return it and whether one did.

        Args:
            attempt: search by a rule, and a run of its result; returns the result, and the instants, as in
                `between`, at which the run refuses it, or None. They count in the next search.
        """
        between = self.between
        for share in STRICTER:
            candidate, refused_instants = attempt(replace(self, between=between).stricter(share))
            if refused_instants is None:
                return candidate, True
            between = np.union1d(between, refused_instants)
        return candidate, False

    @property
    def counted(self) -> list[int]:
        """Indices of the joints that count."""
        return sorted({*range(len(self.robot.joints))} - self.ignored)

    def refused(self, part: TaskSamples) -> BoolArray:
        """Return a mask of the samples that are not accepted, (samples, joints)."""
        block = compute_block(self.robot, part.motion, self.min_margin)
        values = map(block.of_joint, range(len(self.robot.joints)))
        joint_masks = [
            self._refused_mask(joint, joint_values, part.instants)
            for joint, joint_values in zip(self.robot.joints, values, strict=True)
        ]
        refused = np.stack(joint_masks, axis=1)
        refused[:, list(self.ignored)] = False
        return refused

    def parts(self, trajectory: Trajectory, factor: float = 1.0) -> Iterator[TaskSamples]:
        """Yield all samples of a motion, stretched by a factor or not, in blocks; then those of `between`."""
        block_samples = usual_block(len(self.robot.joints))
        for start in range(0, trajectory.samples, block_samples):
            yield TaskSamples.of(trajectory, start, start + block_samples, factor)
        if self.between.size:
            yield TaskSamples.between(trajectory, self.between, factor)

    def watched(self, trajectory: Trajectory, steps: int) -> TaskSamples:
        """Return at most this many samples of a motion, and all of `between`."""
        parts = [evenly_spaced_samples(trajectory, steps)]
        if self.between.size:
            parts.append(TaskSamples.between(trajectory, self.between))
        return concatenate_task_samples(parts)

    def watched_at_rest(self, trajectory: Trajectory) -> TaskSamples:
        """Return at most `REST_SAMPLES` samples of a motion, held, and all of `between`."""
        return self.watched(trajectory, REST_SAMPLES).slowed(math.inf)

    def refused_steps(self, joint: Joint, load: Load) -> BoolArray:
        """Return a mask of the samples of one joint that are not accepted, (samples,)."""
        return self._refused_mask(joint, self._drive_variables(joint, load), load.instants)

    def beyond_position(self, joint: Joint, load: Load) -> Finding | None:
        """Return the worst violation of the position limit of one joint, which no timing changes."""
        return self._limit_violation(joint, {"q": load.command.q}, load.time, load.instants)

    def reasons(self, part: TaskSamples) -> tuple[str, ...]:
        """Return the worst violation of each joint with a refused sample, as clauses."""
        joints = enumerate(zip(self.robot.joints, part.loads(self.robot), strict=True))
        clauses = (self.reason(*pair) for index, pair in joints if index not in self.ignored)
        return tuple(reason for reason in clauses if reason)

    def worst(self, joint: Joint, load: Load) -> Finding | None:
        """Return the worst violation among the samples of one joint; None if all are accepted."""
        values = self._drive_variables(joint, load)
        limit_finding = self._limit_violation(joint, values, load.time, load.instants)
        return self._margin_violation(joint, load, values) or limit_finding

    def reason(self, joint: Joint, load: Load) -> str:
        """Return the worst violation of one joint as a clause; "" if all samples are accepted."""
        worst = self.worst(joint, load)
        return "" if worst is None else worst.clause

    def path_reason(self, joint: Joint, load: Load) -> str:
        """Return a position or velocity limit that the motion exceeds, as a clause; "" if there is none."""
        worst = self._limit_violation(joint, _path_variables(load), load.time, load.instants)
        return "" if worst is None else worst.clause

    def beyond_path(self, joint: Joint, load: Load) -> BoolArray:
        """Return a mask of the samples that exceed a limit of position or velocity, (samples,)."""
        return np.asarray(self._limit_flags(joint, _path_variables(load), load.instants) != 0)

    def _drive_variables(self, joint: Joint, load: Load) -> VariablesOfJoint:
        """Return all variables of one joint, by name."""
        return drive(joint, load.command, self.min_margin).by_name()

    def _refused_mask(self, joint: Joint, values: VariablesOfJoint, instants: Instants) -> BoolArray:
        margins = margin(values["stiffness"], values["stiffness_min"], values["stiffness_max"])
        flags = values["flags"]
        refused: BoolArray = (margins < self.min_margin) | has_flag(flags, Flag.INFEASIBLE)
        refused |= self._near_limit_mask(joint, values)
        if self.recorded is not None:
            flags = self.recorded.flags(self.robot, joint, values, instants)
        return refused | has_flag(flags, LIMITS)

    def _near_limit_mask(self, joint: Joint, values: VariablesOfJoint) -> BoolArray:
        """Return a mask of the samples closer to a limit than the reserve, (samples,)."""
        near = np.zeros(len(values["flags"]), dtype=np.bool_)
        for check in limit_checks(joint) if self.reserve else ():
            if check.variable in RESERVED:
                near |= check.clearance(values) < self.reserve
        return near

    def _margin_violation(self, joint: Joint, load: Load, values: VariablesOfJoint) -> Finding | None:
        """Return the sample that is furthest from the required margin, if it is short of it."""
        commanded_stiffness = load.command.commanded["stiffness"]
        lower, upper = values["stiffness_min"], values["stiffness_max"]
        margins = margin(commanded_stiffness, lower, upper)
        margins[np.isnan(margins)] = np.inf
        margins[has_flag(values["flags"], Flag.INFEASIBLE) & np.isnan(lower)] = -np.inf
        index = int(margins.argmin())
        if margins[index] >= self.min_margin:
            return None
        min_stiffness, max_stiffness = (
            lower[index] / (1 - self.min_margin),
            upper[index] / (1 + self.min_margin),
        )
        bound = (
            min_stiffness
            if math.isnan(min_stiffness) or commanded_stiffness[index] < min_stiffness
            else max_stiffness
        )
        end = lower[index] if bound == min_stiffness else upper[index]
        return Finding(
            MARGIN,
            float(load.time[index]),
            float(commanded_stiffness[index]),
            float(bound),
            units.STIFFNESS.unit(joint.type),
            joint=joint.name,
            end=float(end),
            margin=self.min_margin,
        )

    def _limit_violation(
        self, joint: Joint, values: VariablesOfJoint, time: FloatArray, instants: Instants
    ) -> Finding | None:
        """Return the worst violation of the first limit that the given variables exceed, if there is one."""
        flags = self._limit_flags(joint, values, instants)
        checks = (check for check in limit_checks(joint) if check.variable in values)
        findings = (worst_excess(joint, check, values, time, has_flag(flags, check.flag)) for check in checks)
        return next(filter(None, findings), None)

    def _limit_flags(self, joint: Joint, values: VariablesOfJoint, instants: Instants) -> FlagArray:
        """Return the flags of the limits that the given variables exceed, (samples,)."""
        flags = limit_flags(joint, values, np.zeros(len(instants.time), dtype=FLAG_TYPE))
        if self.recorded is None:
            return flags
        return self.recorded.flags(self.robot, joint, {**values, "flags": flags}, instants)


def _path_variables(load: Load) -> VariablesOfJoint:
    """Return the variables of a load on which neither stiffness nor branch has an effect."""
    return {"q": load.command.q, "dq": load.command.dq}


BISECTIONS = 50
"""Bisections of the interval 0 to 1, down to rounding."""


class Range(NamedTuple):
    """Admissible stiffness, minimum and maximum, (samples,); none where low > high or low is NaN."""

    low: FloatArray
    high: FloatArray


def checked_range(acceptance: Acceptance, joint: Joint, load: Load) -> Range:
    """Return the admissible stiffness at every instant of a load; `low` is never NaN.

    Raises:
        ImpossibleError: no stiffness fixes the joint, or its stiffness cannot be chosen.
    """
    variable_stiffness_actuator(joint)
    if reason := acceptance.path_reason(joint, load):
        raise ImpossibleError(
            f"{reason}; the stiffness has no effect on that: change the motion or the limit"
        )
    admissible = admissible_stiffness(joint, load.command, acceptance.min_margin)
    if np.isnan(admissible.low).any():
        raise ImpossibleError(acceptance.reason(joint, load))
    return admissible


def variable_stiffness_actuator(joint: Joint) -> Actuator:
    """Return the actuator of a joint, if its stiffness can be chosen.

    Raises:
        ImpossibleError: the stiffness cannot be chosen.
    """
    if "stiffness" not in joint.actuator.commanded:
        raise ImpossibleError(f"the actuator of {joint.name} has no stiffness to choose")
    return joint.actuator


def admissible_stiffness(joint: Joint, command: Command, min_margin: float) -> Range:
    """Return the stiffness range that keeps the margin, the stiffness limits and the deflection limits.

    The margin min(sigma - lower, upper - sigma)/sigma >= m means lower/(1-m) <= sigma <= upper/(1+m).

    Args:
        joint: joint with springs and limits.
        command: command that gives the elastic torque; its stiffness serves as a scale only.
        min_margin: margin m.
    """
    actuator = variable_stiffness_actuator(joint)
    corridor = actuator.solve(command.tau_e, command.commanded["stiffness"], command.q)
    min_limit, max_limit = joint.limits.stiffness
    low = np.maximum(corridor.lower / (1 - min_margin), min_limit)
    high = np.minimum(corridor.upper / (1 + min_margin), max_limit)
    if np.isinf(actuator.max_deflections).all():
        return Range(low, high)
    return Range(low, np.minimum(high, _deflection_ceiling(actuator, command, corridor.lower)))


def _deflection_ceiling(actuator: Actuator, command: Command, lower: FloatArray) -> FloatArray:
    """Return the largest stiffness above `lower` at which both deflections keep their limits, by bisection.

    Preload grows with stiffness: phi_1 increases and phi_2 decreases, or vice versa. The bisected x maps
    0..1 to all stiffness above `lower`, as lower + scale x/(1 - x).
    """
    limits = np.array(actuator.max_deflections)[:, None]
    accepted_share, refused_share = np.zeros_like(lower), np.ones_like(lower)
    for _ in range(BISECTIONS):
        share = (accepted_share + refused_share) / 2
        stiffness = lower + command.commanded["stiffness"] * share / (1 - share)
        solution = actuator.solve(command.tau_e, stiffness, command.q)
        within_limits = np.all(np.abs(solution.deflections) <= limits, axis=0)
        accepted_share, refused_share = (
            np.where(within_limits, share, accepted_share),
            np.where(within_limits, refused_share, share),
        )
    return lower + command.commanded["stiffness"] * accepted_share / (1 - accepted_share)


REFUSED_VERDICTS = ("infeasible", "singular", "over_limit")
"""Verdicts that a fix must remove. Unreliable is not among them: no fix makes a recording less uncertain."""

CHECK_SUBDIVISIONS = 10
"""Subdivisions of each sampling interval when a motion is checked between its samples."""

MAX_CHECK_INSTANTS = 300_000
"""Largest number of instants in this check: the intervals of longer motions get fewer subdivisions."""

MAX_REFUSED_INSTANTS = 1000
"""Largest number of refused instants that this check returns."""


class Verification(NamedTuple):
    """The outcome of the run of a motion.

    Attributes:
        joints: findings of the run at each joint.
        refused: instants at which it misses the margin or a limit, as times since the start of the unchanged
            task, s: the worst ones of the run, also between samples, and those of a grid
            `CHECK_SUBDIVISIONS` times as fine; none if only the self-check fails. None if the motion is
            confirmed.
    """

    joints: Sequence[JointReport]
    refused: FloatArray | None


def verify(acceptance: Acceptance, run: PreparedRun, factor: float = 1.0) -> Verification:
    """Run a motion, and check it by a rule.

    Args:
        acceptance: acceptance rule.
        run: robot and motion.
        factor: factor by which the motion is stretched, compared with the unchanged task.
    """
    batch = Batch(Variants.of_one(run.robot), [run.trajectory], min_margin=acceptance.min_margin)
    for _ in batch:
        pass
    report = batch.findings()
    return Verification(report.joints, _refused_instants(acceptance, run, factor, report))


def _refused_instants(
    acceptance: Acceptance, run: PreparedRun, factor: float, report: Report
) -> FloatArray | None:
    """Return `Verification.refused` of a run with its report."""
    joints = [report.joints[index] for index in acceptance.counted]
    times = [worst.time for tool in report.tools for worst in tool.worst.values()]
    for joint in joints:
        if joint.margin < acceptance.min_margin or any(map(joint.shows, REFUSED_VERDICTS)):
            findings = (*joint.worst.values(), *joint.between.values())
            times += [joint.margin_time, *(finding.time for finding in findings)]
    between = _refused_instants_between(acceptance, run, factor)
    if report.self_check.passed and not times and not between.size:
        return None
    elapsed = (np.array(times) - run.trajectory.start) / factor
    return np.union1d(elapsed[np.isfinite(elapsed)], between)


def _refused_instants_between(acceptance: Acceptance, run: PreparedRun, factor: float) -> FloatArray:
    """Return up to `MAX_REFUSED_INSTANTS` refused instants between the samples of a motion, s.

    With the worst instants of the run alone, 7 of 44 fixes of random tasks miss the margin on this grid.
    """
    robot, trajectory = run
    # the allowance for the noise of a recording is known at samples only; the run checks between them
    if not trajectory.known_between or trajectory.estimates:
        return np.empty(0)
    acceptance = replace(acceptance, robot=robot, between=np.empty(0))
    elapsed_samples = (trajectory.times.block(0, trajectory.samples) - trajectory.start) / factor
    subdivisions = max(1, min(CHECK_SUBDIVISIONS, MAX_CHECK_INSTANTS // len(elapsed_samples)))
    elapsed = (
        elapsed_samples[:-1, None]
        + np.diff(elapsed_samples)[:, None] * np.arange(1, subdivisions) / subdivisions
    ).ravel()
    refused = np.concatenate(
        [
            part[acceptance.refused(TaskSamples.between(trajectory, part, factor)).any(axis=1)]
            for part in np.array_split(elapsed, 1 + len(elapsed) // usual_block(trajectory.joints))
        ]
    )
    return refused[evenly(len(refused), MAX_REFUSED_INSTANTS)]


def verify_fix(acceptance: Acceptance, fix: Fix) -> tuple[Fix, FloatArray | None]:
    """Return a fix with the findings of its run, and the instants that refuse it; see `Verification`."""
    joints, refused = verify(acceptance, PreparedRun(fix.robot, fix.trajectory), 1 + fix.longer)
    return replace(fix, joints=joints), refused
