"""Fixes of tools that are too soft: one factor on the stiffness of the joints that move a tool.

Where these do not suffice, the factor is one on the joints coupled with them, or on all of these joints.
The factor is added to each fix of the joints, or replaces them if that is enough. Loads do not depend on the
stiffness, so that the admissible range of each joint bounds the factor on both sides.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import joined, significant
from vsacli.base.units import LINEAR_STIFFNESS
from vsacli.base.wrench import Wrench
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import usual_block
from vsacli.robot.compliance import HeldPose, coupled_joints, softest_direction
from vsacli.robot.model import Robot
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, checked_range, verify_fix
from vsacli.studies.search.changed_motion import with_scaled_stiffness
from vsacli.studies.search.fix_report import (
    NOT_CONFIRMED,
    Fix,
    Fixes,
    NotPossible,
    StifferTools,
    StiffnessFactor,
    in_order,
)
from vsacli.studies.search.loads import joint_loads
from vsacli.studies.search.recorded_limits import RecordedLimits
from vsacli.trajectory.trajectory import Trajectory

MAX_FACTOR = 1e3
"""Largest factor that is tried where springs have no largest stiffness."""

JOINTS_FALL_SHORT = "joints fall short as well, which a factor on the stiffness does not change"
"""Reason why no factor does alone what it does together with a fix of joints."""

BISECTIONS = 20
"""Halvings of the range of a factor: at most 1e-5 of it remains, less than its four digits."""


def with_stiff_tools(robot: Robot, trajectory: Trajectory, joint_fixes: Fixes) -> Fixes:
    """Return the fixes of a robot whose tools have limits.

    Tools that no factor makes stiff enough are left out, and their findings have the reason.

    Args:
        robot: Robot, with limits of tools.
        trajectory: Commanded motion.
        joint_fixes: Fixes of the robot without these limits.
    """
    findings = _HeldRun(robot, trajectory).findings
    if not findings:
        return joint_fixes
    refuse_damped_transmissions(robot, trajectory, "fixes")
    unfixable_joints = {cause.joint for cause in joint_fixes.causes if not cause.fixable}
    ignored = frozenset(index for index, name in enumerate(robot.joint_names) if name in unfixable_joints)
    rule = Acceptance(robot, joint_fixes.min_margin, RecordedLimits(trajectory), ignored=ignored)
    candidates = [Fix(0.0, robot, trajectory, asked=trajectory), *joint_fixes.fixes]
    confirmed_fixes, hopeless = _confirmed_fixes(rule, candidates)
    if hopeless:
        fixable_rule = replace(rule, robot=robot.without_tool_limits(hopeless))
        confirmed_fixes, _ = _confirmed_fixes(fixable_rule, candidates)
    factor_alone = next(
        (fix.stiffness_factor for fix in confirmed_fixes if fix.kinds == {"stiffness_factor"}), None
    )
    reasons_against = (JOINTS_FALL_SHORT,) if joint_fixes.needed else (NOT_CONFIRMED,)
    causes = (
        replace(finding, fixable=bool(confirmed_fixes) and not advice, advice=advice)
        for finding in findings
        for advice in [hopeless.get(finding.tool or "", "")]
    )
    return replace(
        joint_fixes,
        stiffness_factor=factor_alone or NotPossible(tuple(hopeless.values()) or reasons_against),
        causes=(*joint_fixes.causes, *causes),
        fixes=tuple(in_order(confirmed_fixes)),
    )


def _confirmed_fixes(acceptance: Acceptance, candidates: Sequence[Fix]) -> tuple[list[Fix], dict[str, str]]:
    """Return the fixes with factors that a run confirms, and that no simpler one replaces.

    Without any, the tools that no factor makes stiff enough, whatever the fix, follow with the reason.
    """
    robot, confirmed_fixes = acceptance.robot, list[Fix]()
    reasons_by_fix: list[dict[str, str]] = []
    for fix in candidates:
        stiffened_fix, too_soft = _with_stiffness_factors(
            replace(fix, robot=replace(fix.robot, tools=robot.tools)), acceptance
        )
        reasons_by_fix.append(too_soft)
        replaced = any(stiffened_fix.kinds >= simpler.kinds for simpler in confirmed_fixes)
        if stiffened_fix.kinds and not too_soft and not replaced:
            confirmed, refused = verify_fix(acceptance, stiffened_fix)
            confirmed_fixes += [confirmed] if refused is None else []
    reasons = {} if confirmed_fixes else reasons_by_fix[0]
    return confirmed_fixes, {
        name: reasons[name] for name in reasons if all(name in each for each in reasons_by_fix)
    }


class _HeldRun:
    """A run of a motion, at whose samples motors may be held with another stiffness of the joints."""

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self._robot = robot
        run = Run(robot, trajectory)
        blocks = [(block.q, block.stiffness, block.wrench) for block in run]
        q, stiffness, wrench = zip(*blocks, strict=True)
        self._q, self._stiffness = np.concatenate(q), np.concatenate(stiffness)
        self._frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self._components = None if self._frame is None else np.concatenate(wrench)
        self.findings = [finding for tool in run.findings().tools for finding in tool.worst.values()]

    def min_stiffness_of(self, tool: int, scales: FloatArray) -> float:
        """Return the smallest stiffness of a tool with scaled joint stiffness, (joints,); 0 if unstable."""
        min_stiffness, block_samples = math.inf, usual_block(len(self._robot.joints))
        for start in range(0, len(self._q), block_samples):
            block = slice(start, start + block_samples)
            wrench = None
            if self._frame is not None and self._components is not None:
                wrench = Wrench.constant(self._components[block], self._frame)
            pose = HeldPose(self._robot, self._q[block], scales * self._stiffness[block], wrench)
            stiffness, _ = softest_direction(pose.compliance(tool)[0])
            min_stiffness = min(min_stiffness, float(np.nan_to_num(stiffness, nan=0.0, posinf=np.inf).min()))
        return min_stiffness

    def is_too_soft(self, tool: int, scales: FloatArray) -> bool:
        """Return whether a tool is softer than it may be, or unstable; one without a limit may be soft."""
        min_stiffness = self.min_stiffness_of(tool, scales)
        return min_stiffness <= 0 or min_stiffness < (self._robot.end_effectors[tool].min_stiffness or 0.0)


def _with_stiffness_factors(fix: Fix, acceptance: Acceptance) -> tuple[Fix, dict[str, str]]:
    """Return a fix with the smallest factors that make its tools stiff enough, and why some stay too soft."""
    trajectory, robot = fix.trajectory, fix.robot
    acceptance, held_run = replace(acceptance, robot=robot), _HeldRun(robot, trajectory)
    scales, stiffness_factors, too_soft = (
        np.ones(len(robot.joints)),
        list[StiffnessFactor](),
        dict[str, str](),
    )
    limited_tools = range(len(robot.tools)) if robot.limited_tools else ()
    soft_tools = [tool for tool in limited_tools if held_run.is_too_soft(tool, scales)]
    for tools, moving_joints in _joint_sets(robot, soft_tools):
        if not any(held_run.is_too_soft(tool, scales) for tool in tools):
            continue  # the factors for other tools suffice
        reasons: list[str] = []
        for joints in _with_coupled(robot, tools, moving_joints):
            try:
                factor_range = _factor_range(acceptance, trajectory, joints)
                factor = _smallest_factor(robot, held_run, tools, joints, scales, factor_range)
            except ImpossibleError as error:
                reasons.append(str(error))
                continue
            scales[joints] = factor
            names = tuple(robot.joint_names[joint] for joint in joints)
            stiffness_factors = [
                *_without_factors_on(stiffness_factors, names),
                StiffnessFactor(factor, names),
            ]
            break
        else:
            too_soft |= dict.fromkeys((robot.tool_names[tool] for tool in tools), reasons[0])
    factors = {joint: float(scales[joint]) for joint in np.flatnonzero(scales != 1).tolist()}
    stiffened = replace(
        fix,
        size=math.hypot(fix.size, *(factor - 1 for factor in factors.values())),
        declared=with_scaled_stiffness(fix.declared, factors) if factors else fix.declared,
        stiffness_factor=StifferTools(tuple(stiffness_factors)) if stiffness_factors else None,
    )
    return stiffened, too_soft


def _joint_sets(robot: Robot, tools: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """Return tools with the joints that move them and have a commanded stiffness; the sets are disjoint."""
    tools_and_joints: list[tuple[list[int], list[int]]] = []
    for tool in tools:
        path = robot.paths[robot.tool_joints[tool]]
        joints = {joint for joint in path if STIFFNESS.key in robot.joints[joint].actuator.commanded}
        overlapping = [entry for entry in tools_and_joints if joints & {*entry[1]}]
        tools_and_joints = [entry for entry in tools_and_joints if entry not in overlapping]
        merged_tools = [tool, *(other for entry in overlapping for other in entry[0])]
        tools_and_joints.append((merged_tools, sorted(joints.union(*(entry[1] for entry in overlapping)))))
    return tools_and_joints


def _with_coupled(robot: Robot, tools: Sequence[int], moving: list[int]) -> list[list[int]]:
    """Return the joints that move tools, those coupled with them, and all these: sets to be tried in turn."""
    coupled_indices = {joint for tool in tools for joint in coupled_joints(robot, tool)}
    stiffness_joints = {
        joint for joint in coupled_indices if STIFFNESS.key in robot.joints[joint].actuator.commanded
    }
    other_joints = sorted(stiffness_joints.difference(moving))
    return [moving, other_joints, sorted((*moving, *other_joints))] if other_joints else [moving]


def _without_factors_on(parts: Sequence[StiffnessFactor], names: Collection[str]) -> list[StiffnessFactor]:
    """Return factors without those on some joints, which another factor replaces."""
    remaining = [(part, tuple(name for name in part.joints if name not in names)) for part in parts]
    return [replace(part, joints=joints) for part, joints in remaining if joints]


def _factor_range(
    acceptance: Acceptance, trajectory: Trajectory, joints: Sequence[int]
) -> tuple[float, float]:
    """Return the smallest and largest factor, from 1 on, that margins and limits of joints admit."""
    low, high = 1.0, MAX_FACTOR
    for joint, load in zip(joints, joint_loads(acceptance.robot, trajectory, list(joints)), strict=True):
        admissible = checked_range(acceptance, acceptance.robot.joints[joint], load)
        commanded_stiffness = load.command.commanded[STIFFNESS.key]
        low = max(low, float((admissible.low / commanded_stiffness).max()))
        high = min(high, float((admissible.high / commanded_stiffness).min()))
    return low, high


def _smallest_factor(
    robot: Robot,
    held_run: _HeldRun,
    tools: Sequence[int],
    joints: Sequence[int],
    chosen_scales: FloatArray,
    factor_range: tuple[float, float],
) -> float:
    """Return the smallest factor in a range with which no tool is too soft, rounded up to four digits.

    Factors already chosen for other tools, (joints,), are kept at other joints, and not reduced at these.
    """
    if not joints:
        tool_name = robot.tool_names[tools[0]]
        raise ImpossibleError(f"no joint that moves {tool_name} has a stiffness to choose")
    scales, names = chosen_scales.copy(), joined([robot.joint_names[joint] for joint in joints])
    low, high = max(factor_range[0], float(chosen_scales[list(joints)].max())), factor_range[1]

    def soft_tools(factor: float) -> list[int]:
        scales[list(joints)] = factor
        return [tool for tool in tools if held_run.is_too_soft(tool, scales)]

    if high < low:
        raise ImpossibleError(f"no factor keeps the margins and limits of all of {names}")
    if soft_indices := soft_tools(high):
        min_stiffness, unit = held_run.min_stiffness_of(soft_indices[0], scales), LINEAR_STIFFNESS.unit("")
        raise ImpossibleError(
            f"with {high:.4g} times their stiffness, the most that {names} may have, the stiffness of "
            f"{robot.tool_names[soft_indices[0]]} is {significant(min_stiffness)} {unit}"
        )
    for _ in range(BISECTIONS if soft_tools(low) else 0):
        middle_factor = math.sqrt(low * high)
        low, high = (middle_factor, high) if soft_tools(middle_factor) else (low, middle_factor)
    smallest = high if soft_tools(low) else low
    rounded = float(significant(smallest, toward=math.inf))
    return rounded if rounded <= factor_range[1] else smallest
