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
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError, checked_range, verify_fixes
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

LARGEST_FACTOR = 1e3
"""Largest factor that is tried where springs have no largest stiffness."""

JOINTS_FALL_SHORT = "joints fall short as well, which a factor on the stiffness does not change"
"""Reason why no factor does alone what it does together with a fix of joints."""

BISECTIONS = 20
"""Halvings of the range of a factor: at most 1e-5 of it remains, less than its four digits."""


def with_stiff_tools(robot: Robot, trajectory: Trajectory, of_joints: Fixes) -> Fixes:
    """Return the fixes of a robot whose tools have limits.

    Tools that no factor makes stiff enough are left out, and their findings have the reason.

    Args:
        robot: Robot, with limits of tools.
        trajectory: Commanded motion.
        of_joints: Fixes of the robot without these limits.
    """
    findings = _HeldRun(robot, trajectory).findings
    if not findings:
        return of_joints
    refuse_damped_transmissions(robot, trajectory, "fixes")
    left_out = {cause.joint for cause in of_joints.causes if not cause.fixable}
    ignored = frozenset(index for index, name in enumerate(robot.joint_names) if name in left_out)
    rule = Acceptance(robot, of_joints.min_margin, RecordedLimits(trajectory), ignored=ignored)
    candidates = [Fix(0.0, robot, trajectory, asked=trajectory), *of_joints.fixes]
    chosen, hopeless = _confirmed_fixes(rule, candidates)
    if hopeless:
        limited = replace(rule, robot=robot.without_tool_limits(hopeless))
        chosen, _ = _confirmed_fixes(limited, candidates)
    alone = next((fix.stiffness_factor for fix in chosen if fix.kinds == {"stiffness_factor"}), None)
    not_alone = (JOINTS_FALL_SHORT,) if of_joints.needed else (NOT_CONFIRMED,)
    causes = (
        replace(finding, fixable=bool(chosen) and not advice, advice=advice)
        for finding in findings
        for advice in [hopeless.get(finding.tool or "", "")]
    )
    return replace(
        of_joints,
        stiffness_factor=alone or NotPossible(tuple(hopeless.values()) or not_alone),
        causes=(*of_joints.causes, *causes),
        fixes=tuple(in_order(chosen)),
    )


def _confirmed_fixes(acceptance: Acceptance, candidates: Sequence[Fix]) -> tuple[list[Fix], dict[str, str]]:
    """Return the fixes with factors that a run confirms, and that no simpler one replaces.

    Without any, the tools that no factor makes stiff enough, whatever the fix, follow with the reason.
    """
    robot, chosen = acceptance.robot, list[Fix]()
    hopeless: list[dict[str, str]] = []
    for fix in candidates:
        factors, too_soft = _stiffened(replace(fix, robot=replace(fix.robot, tools=robot.tools)), acceptance)
        hopeless.append(too_soft)
        replaced = any(factors.kinds >= simpler.kinds for simpler in chosen)
        if factors.kinds and not too_soft and not replaced:
            ((confirmed, refused),) = verify_fixes(acceptance, [factors])
            chosen += [confirmed] if refused is None else []
    common = {} if chosen else hopeless[0]
    return chosen, {name: common[name] for name in common if all(name in each for each in hopeless)}


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
        self.findings = [worst for tool in run.findings().tools for worst in tool.worst.values()]

    def least_stiffness(self, tool: int, scales: FloatArray) -> float:
        """Return the smallest stiffness of a tool with scaled joint stiffness, (joints,); 0 if unstable."""
        least, samples = math.inf, usual_block(len(self._robot.joints))
        for start in range(0, len(self._q), samples):
            part = slice(start, start + samples)
            wrench = None
            if self._frame is not None and self._components is not None:
                wrench = Wrench.constant(self._components[part], self._frame)
            pose = HeldPose(self._robot, self._q[part], scales * self._stiffness[part], wrench)
            stiffness, _ = softest_direction(pose.compliance(tool)[0])
            least = min(least, float(np.nan_to_num(stiffness, nan=0.0, posinf=np.inf).min()))
        return least

    def lacks(self, tool: int, scales: FloatArray) -> bool:
        """Return whether a tool is softer than it may be, or unstable; one without a limit may be soft."""
        least = self.least_stiffness(tool, scales)
        return least <= 0 or least < (self._robot.end_effectors[tool].min_stiffness or 0.0)


def _stiffened(fix: Fix, acceptance: Acceptance) -> tuple[Fix, dict[str, str]]:
    """Return a fix with the smallest factors that make its tools stiff enough, and why some stay too soft."""
    trajectory, robot = fix.trajectory, fix.robot
    acceptance, held = replace(acceptance, robot=robot), _HeldRun(robot, trajectory)
    scales, parts, too_soft = np.ones(len(robot.joints)), list[StiffnessFactor](), dict[str, str]()
    judged = range(len(robot.tools)) if robot.limited_tools else ()
    soft = [tool for tool in judged if held.lacks(tool, scales)]
    for tools, moving in _sets_of_joints(robot, soft):
        if not any(held.lacks(tool, scales) for tool in tools):
            continue  # the factors for other tools suffice
        reasons: list[str] = []
        for joints in _with_coupled(robot, tools, moving):
            try:
                allowed = _range_of_factor(acceptance, trajectory, joints)
                factor = _smallest_factor(robot, held, tools, joints, scales, allowed)
            except ImpossibleError as error:
                reasons.append(str(error))
                continue
            scales[joints] = factor
            names = tuple(robot.joint_names[joint] for joint in joints)
            parts = [*_without_joints(parts, names), StiffnessFactor(factor, names)]
            break
        else:
            too_soft |= dict.fromkeys((robot.tool_names[tool] for tool in tools), reasons[0])
    factors = {joint: float(scales[joint]) for joint in np.flatnonzero(scales != 1).tolist()}
    stiffened = replace(
        fix,
        size=math.hypot(fix.size, *(factor - 1 for factor in factors.values())),
        declared=with_scaled_stiffness(fix.declared, factors) if factors else fix.declared,
        stiffness_factor=StifferTools(tuple(parts)) if parts else None,
    )
    return stiffened, too_soft


def _sets_of_joints(robot: Robot, tools: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """Return tools with the joints that move them and have a commanded stiffness; the sets are disjoint."""
    sets: list[tuple[list[int], list[int]]] = []
    for tool in tools:
        path = robot.paths[robot.tool_joints[tool]]
        joints = {joint for joint in path if STIFFNESS.key in robot.joints[joint].actuator.commanded}
        shared = [entry for entry in sets if joints & {*entry[1]}]
        sets = [entry for entry in sets if entry not in shared]
        of_tools = [tool, *(other for entry in shared for other in entry[0])]
        sets.append((of_tools, sorted(joints.union(*(entry[1] for entry in shared)))))
    return sets


def _with_coupled(robot: Robot, tools: Sequence[int], moving: list[int]) -> list[list[int]]:
    """Return the joints that move tools, those coupled with them, and all these: sets to be tried in turn."""
    coupled = {joint for tool in tools for joint in coupled_joints(robot, tool)}
    chosen = {joint for joint in coupled if STIFFNESS.key in robot.joints[joint].actuator.commanded}
    beside = sorted(chosen.difference(moving))
    return [moving, beside, sorted((*moving, *beside))] if beside else [moving]


def _without_joints(parts: Sequence[StiffnessFactor], names: Collection[str]) -> list[StiffnessFactor]:
    """Return factors without those on some joints, which another factor replaces."""
    kept = [(part, tuple(name for name in part.joints if name not in names)) for part in parts]
    return [replace(part, joints=joints) for part, joints in kept if joints]


def _range_of_factor(
    acceptance: Acceptance, trajectory: Trajectory, joints: Sequence[int]
) -> tuple[float, float]:
    """Return the smallest and largest factor, from 1 on, that margins and limits of joints admit."""
    low, high = 1.0, LARGEST_FACTOR
    for joint, load in zip(joints, joint_loads(acceptance.robot, trajectory, list(joints)), strict=True):
        admissible = checked_range(acceptance, acceptance.robot.joints[joint], load)
        asked = load.command.commanded[STIFFNESS.key]
        low = max(low, float((admissible.low / asked).max()))
        high = min(high, float((admissible.high / asked).min()))
    return low, high


def _smallest_factor(
    robot: Robot,
    held: _HeldRun,
    tools: Sequence[int],
    joints: Sequence[int],
    chosen: FloatArray,
    allowed: tuple[float, float],
) -> float:
    """Return the smallest factor in a range with which no tool is too soft, rounded up to four digits.

    Factors already chosen for other tools, (joints,), are kept at other joints, and not reduced at these.
    """
    if not joints:
        moved = robot.tool_names[tools[0]]
        raise ImpossibleError(f"no joint that moves {moved} has a stiffness to choose")
    scales, names = chosen.copy(), joined([robot.joint_names[joint] for joint in joints])
    low, high = max(allowed[0], float(chosen[list(joints)].max())), allowed[1]

    def soft_tools(factor: float) -> list[int]:
        scales[list(joints)] = factor
        return [tool for tool in tools if held.lacks(tool, scales)]

    if high < low:
        raise ImpossibleError(f"no factor keeps the margins and limits of all of {names}")
    if soft := soft_tools(high):
        least, unit = held.least_stiffness(soft[0], scales), LINEAR_STIFFNESS.unit("")
        raise ImpossibleError(
            f"with {high:.4g} times their stiffness, the most that {names} may have, the stiffness of "
            f"{robot.tool_names[soft[0]]} is {significant(least)} {unit}"
        )
    for _ in range(BISECTIONS if soft_tools(low) else 0):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if soft_tools(middle) else (low, middle)
    smallest = high if soft_tools(low) else low
    rounded = float(significant(smallest, toward=math.inf))
    return rounded if rounded <= allowed[1] else smallest
