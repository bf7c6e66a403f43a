"""Comparison of column names with joint names, regardless of case, separators and common words."""

from __future__ import annotations

import re
from collections.abc import Sequence

WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")

QUANTITIES = {
    "q": ("position", "positions", "pos", "q", "qpos", "angle", "angles", "enc", "encoder", "encoders"),
    "dq": ("velocity", "velocities", "vel", "dq", "qd", "qdot", "qvel", "speed"),
    "tau_motor_1": ("effort", "efforts", "torque", "torques", "tau", "trq"),
    "stiffness": ("stiffness",),
    "theta": ("theta", "thetas"),
}
"""Words for each quantity of a joint; `theta` alone may be of a joint or a motor, and is not used."""

MEASURED, PLAIN, FILTERED, RAW, COMMANDED, ERROR = "measured", "", "filtered", "raw", "commanded", "error"

ROLES = {
    MEASURED: (
        *("act", "actual", "meas", "measured", "measurement", "real", "state", "states"),
        *("ist", "feedback", "fbk", "observed"),
    ),
    PLAIN: (),
    FILTERED: ("filt", "filtered", "filter", "lowpass", "lp", "smooth", "smoothed"),
    RAW: ("raw", "unfiltered"),
    COMMANDED: (
        *("des", "desired", "cmd", "cmds", "cmptd", "command", "commands", "commanded", "ref", "reference"),
        *("set", "setpoint", "setpoints", "target", "targets", "goal", "con", "ctrl", "soll", "sp"),
        *("plan", "planned", "computed"),
    ),
    ERROR: ("err", "error", "errors", "diff", "deviation"),
}
"""Words that say what a column shows of its quantity. The first role that a joint has is proposed; a name
with words of several roles has the last one. To support a further word, add it here."""

_ROLE_WORDS = frozenset(word for words in ROLES.values() for word in words)

OF_MOTORS = {"q": "theta", "theta": "theta", "tau_motor_1": "tau_motor"}
"""Variables of motors by the quantity in a name that says which motor it is of."""

MOTOR_WORDS = ("motor", "motors", "mot", "rotor")
"""Words that make a position that of a motor, if the name also says which."""

MOTORS = {"1": 1, "2": 2, "a": 1, "b": 2}
"""Last words of names that say which motor of a joint is meant."""

SIDES_OF_JOINTS = {"l": 1, "left": 1, "r": 2, "right": 2}
"""Words that may tell the motors of a joint apart if columns of both are there, and no joint has the word."""

QUANTITY_WORDS = frozenset(word for words in QUANTITIES.values() for word in words)

_Q, _R = ("|".join(sorted(words, key=len, reverse=True)) for words in (QUANTITY_WORDS, _ROLE_WORDS))
_TOGETHER = re.compile(rf"(?<![a-z])(?:({_Q})({_R})|({_R})({_Q}))(?![a-z])", re.IGNORECASE)

GENERIC = (
    *("field", "joint", "joints", "axis", "data", "current", "name", "msg", "robot", "arm", "motor", "link"),
    *("deg", "degree", "degrees", "rad", "mm", "m", "nm", "n"),
)
"""Words in column names that do not help to identify the joint."""

OF_JOINTS = ("joint", "joints", "axis", "field", "deg", "degree", "degrees", "rad", "mm", "m")
"""Words allowed in a name without a word for a quantity; others, as in `current_1`, indicate a quantity."""

AXES = ("x", "y", "z", "rx", "ry", "rz", "qx", "qy", "qz", "qw", "tcp", "ee", "pose", "cartesian")
"""Words each of which indicates that a name refers to a pose and not to a joint."""

POSES = ("roll", "pitch", "yaw", "tool", "odom", "imu", "linear", "angular", "orientation")
"""Words that do so only if a name has no others, since joints of legs and wrists have such names, too."""


def words_of_column_name(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name in lower case, equal for `joint_01`, `Joint1` and `joint-1`."""
    return tuple(word.lower().lstrip("0") or "0" for word in WORDS.findall(name))


def role_of(name: str) -> tuple[str, str]:
    """Return the role of a column by its name, and the name without the words that say so.

    A word and that for a quantity may be written together, as in `qdes` and `actpos1`.
    """
    separated = _TOGETHER.sub(lambda match: "_".join(filter(None, match.groups())), name)
    words = words_of_column_name(separated)
    role = next((role for role in reversed(ROLES) if set(words).intersection(ROLES[role])), PLAIN)
    return role, WORDS.sub(lambda word: "" if word[0].lower() in _ROLE_WORDS else word[0], separated)


def motor_of(words: Sequence[str], joints: JointNames) -> tuple[int, tuple[str, ...]] | None:
    """Return the number of the motor that a name indicates, and the words for its joint; None for neither.

    Args:
        words: words of the name without that for the quantity, such as `1 a deg` or `elbow motor 2`.
        joints: joint names of the robot. A last number is that of a motor only next to a joint.
    """
    telling = [at for at, word in enumerate(words) if word not in GENERIC and word not in MOTOR_WORDS]
    motor = MOTORS.get(words[telling[-1]]) if len(telling) > 1 else None
    if motor is None:
        return None
    rest = tuple(word for at, word in enumerate(words) if at != telling[-1] and word not in MOTOR_WORDS)
    numbered = all(words[at].isdecimal() for at in telling[:-1])
    return (motor, rest) if numbered or joints.in_words(rest) else None


def side_of(words: Sequence[str], joints: JointNames) -> tuple[int, tuple[str, ...]] | None:
    """Return the motor that the word for a side indicates, and the other words; None without one such word.

    Args:
        words: words of the name without that for the quantity, such as `l 1 deg`.
        joints: joint names of the robot.
    """
    sides = [word for word in words if word in SIDES_OF_JOINTS]
    of_joints = {word for name in joints.names for word in words_of_column_name(name)}
    if len(sides) != 1 or not of_joints.isdisjoint(SIDES_OF_JOINTS):
        return None
    return SIDES_OF_JOINTS[sides[0]], tuple(word for word in words if word != sides[0])


class JointNames:
    """The joint names of a robot, to be found in column names.

    Args:
        names: joint names, in the order of the robot file.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._words = {name: words_of_column_name(name) for name in names}
        first, last = _count_common_words(list(self._words.values()))
        self._cores = {name: words[first : len(words) - last] for name, words in self._words.items()}

    def in_words(self, words: Sequence[str]) -> str:
        """Return the joint with the longest name found in these words; empty for none or for a tie."""
        phrase = f" {' '.join(words)} "
        for whole, of_joints in ((True, self._words), (False, self._cores)):
            candidates = [
                name
                for name, name_words in of_joints.items()
                if name_words and f" {' '.join(name_words)} " in phrase
            ]
            longest = max((len(of_joints[name]) for name in candidates), default=0)
            matches = [name for name in candidates if len(of_joints[name]) == longest]
            if len(matches) == 1 and (whole or self._suffices(of_joints[matches[0]], words)):
                return matches[0]
        return ""

    def called(self, words: Sequence[str]) -> str:
        """Return the joint whose name is the whole column name; empty if there is none."""
        rest = "".join(word for word in words if word not in OF_JOINTS)
        for name in self.names:
            name_words, core = self._words[name], self._cores[name]
            bare = "".join(word for word in name_words if word not in OF_JOINTS)
            if "".join(words) == "".join(name_words) or (rest and rest in (bare, "".join(core))):
                return name
        return ""

    def _suffices(self, core: Sequence[str], words: Sequence[str]) -> bool:
        """Return whether the distinguishing part suffices: a number alone only among generic words."""
        common = {word for name_words in self._words.values() for word in name_words}
        remaining = [word for word in words if word not in core]
        return not all(word.isdecimal() for word in core) or all(
            word in GENERIC or word in common for word in remaining
        )


def _count_common_words(names: Sequence[Sequence[str]]) -> tuple[int, int]:
    """Return the numbers of words common to all names at their beginning, and at their end."""
    if len(names) < 2:  # a single name would be common to all
        return 0, 0
    shortest = min(map(len, names))
    first = next((at for at in range(shortest) if len({words[at] for words in names}) > 1), shortest)
    room = shortest - first
    last = next((at for at in range(room) if len({words[-1 - at] for words in names}) > 1), room)
    return first, last
