"""Words for the parameters of robots and trajectories, whose paths are too technical for axes and titles."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.base import units

AXES, ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
ENTRY_NAMES = {
    "gravity": AXES,
    "com": AXES,
    "xyz": AXES,
    "rpy": ANGLES,
    "motor": ("1", "2"),
    "spring": ("1", "2"),
}
"""Names of the entries of lists, by key."""

KEY_CAPTIONS = {"com": "center of mass", "dh": "DH", "xyz": "", "rpy": "", "joints": "", "actuator": ""}
"""Words in place of keys; empty for keys that say nothing next to the others."""

SYMBOL_LENGTH = 3
"""Maximum length of a key that is a symbol, e.g. `k_c`, and needs its quantity in words."""

SYMBOLS = {
    unit: words
    for quantity, words in (
        (units.STIFFNESS, "{} stiffness"),
        (units.QUADRATIC_STIFFNESS, "quadratic {} stiffness"),
        (units.CUBIC_STIFFNESS, "cubic {} stiffness"),
    )
    for unit in (quantity.revolute, quantity.prismatic)
}
"""Quantities of symbols by their unit; `{}` stands for the part that they belong to."""


def parameter_words(path: str, unit: str, joints: Sequence[str]) -> str:
    """Return a parameter in words, e.g. "spring stiffness k, all joints" for `joints.*.actuator.spring.k`.

    Args:
        path: path of the parameter in the file of a robot or a trajectory; `*` matches anything.
        unit: unit of the parameter, which says what a symbol such as k is; empty if unknown.
        joints: names of the joints, in the order of the robot file.
    """
    keys, joint_text = path.split("."), ""
    is_of_joint = keys[0] == "joints" and len(keys) > 2
    if is_of_joint:
        joint_text, keys = _joint_caption(keys[1], joints), keys[2:]
    elif keys[-1] in joints and len(keys) > 1:
        joint_text, keys = keys[-1], keys[:-1]
    words = [caption for index in range(len(keys)) if (caption := _key_caption(keys, index))]
    if is_of_joint and len(keys[-1]) <= SYMBOL_LENGTH and unit in SYMBOLS and len(words) > 1:
        words = [SYMBOLS[unit].format(" ".join(words[:-1])), keys[-1]]
    return ", ".join(filter(None, (" ".join(words), joint_text)))


def _joint_caption(key: str, joints: Sequence[str]) -> str:
    """Return the joints to which a key of a path applies: a name, an index from 0, or a pattern."""
    if key == "*":
        return "all joints"
    if key.isdecimal() and key not in joints and int(key) < len(joints):
        return joints[int(key)]
    return f"joints {key}" if "*" in key else key


def _key_caption(keys: Sequence[str], index: int) -> str:
    key = keys[index]
    entry_names = ENTRY_NAMES.get(keys[index - 1], ()) if index else ()
    if key.isdecimal() and int(key) < len(entry_names):
        return entry_names[int(key)]
    return KEY_CAPTIONS.get(key, key if len(key) <= SYMBOL_LENGTH else key.replace("_", " "))
