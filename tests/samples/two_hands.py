"""A torso with two arms of one joint, each with a hand, and motions on which hands are pushed."""

from __future__ import annotations

from pathlib import Path

JOINT = """
    type: revolute
    dh: {a: 0.3, alpha: 0}
    link: {mass: 1, com: [-0.1, 0, 0], inertia: {xx: 0.01, yy: 0.01, zz: 0.01}}
    actuator: {type: antagonistic, motor: {inertia: 0.1}, spring: {type: cubic, k: 500, k_c: 3000}}"""

ARM = """
  - name: NAME
    parent: torso
    mount: {xyz: [0, SHIFT, 0.1], rpy: [-90 deg, 0.3, 0]}"""

TOOLS = {
    "left_hand": "{joint: left, xyz: [0.1, 0, 0.02], rpy: [0.4, 0, 0.2]}",
    "right_hand": "{joint: right, xyz: [0, 0.05, 0]}",
}


def two_hands(folder: Path, *tools: str) -> Path:
    """The file of the robot with these tools, both hands if none are named."""
    arms = [("left", "0.2"), ("right", "-0.2")]
    joints = [ARM.replace("NAME", name).replace("SHIFT", shift) + JOINT for name, shift in arms]
    named = "".join(f"\n  {name}: {TOOLS[name]}" for name in tools or TOOLS)
    path = folder / f"{'-'.join(('torso', *tools))}.yaml"
    path.write_text(
        f"format: vsacli-robot/1\nname: two-hands\njoints:\n  - name: torso{JOINT}{''.join(joints)}\n"
        f"tools:{named}\n"
    )
    return path


MOTION = """format: vsacli-trajectory/1
name: pushed
duration: 1
rate: 100
position: {type: polynomial, degree: 9, start: 0.1, end: {torso: 0.5, left: 0.4, right: -0.3}}
stiffness: {type: constant, value: 1200}
"""

PUSH = "{type: polynomial, degree: 5, frame: base, start: [0, 0, 0, 0, 0, 0], end: [5, 1, -2, 0, 0.1, 0]}"
HOLD = "{type: constant, frame: end_effector, value: [1, 2, 3, 0.1, 0, 0.2]}"


def pushed_motion(folder: Path, *lines: str) -> Path:
    """The file of a motion with further lines; tables among them have the times."""
    path, text = folder / "pushed.yaml", MOTION + "\n".join(lines) + "\n"
    path.write_text(text.replace("duration: 1\nrate: 100\n", "") if "csv" in text else text)
    return path


def wrenches(**by_tool: str) -> str:
    """The key `wrenches` in flow style."""
    return f"wrenches: {{{', '.join(f'{tool}: {declared}' for tool, declared in by_tool.items())}}}"
