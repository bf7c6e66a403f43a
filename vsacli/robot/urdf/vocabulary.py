"""The words of URDF 1.0 to 1.2 and of its usual extensions, by what the reader does with each.

A word is the tag of an element, or the name of an attribute after `@`, as in XPath. The reader uses it, or it
has no effect on a robot file, or it is left out and named, or it is refused. Other words are reported.
"""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import NamedTuple

from vsacli.base.errors import Problem
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.xml_tree import Element

ZERO = ("0",)
"""Neutral text of numbers: all of them are zero."""


class LeftOut(NamedTuple):
    """A word that a robot file cannot express.

    Attributes:
        phrase: property in words; empty for the word itself.
        neutral: texts that say the same as leaving the word out.
    """

    phrase: str = ""
    neutral: tuple[str, ...] = ()


@dataclass(frozen=True)
class ElementRule:
    """The words that may stand in an element.

    Attributes:
        used: attributes that the reader uses.
        children: elements that the reader uses, with their own rules.
        without_effect: words about appearance, contact, sensors and control, whose content is not examined.
        left_out: words that are named.
        refused: words that the reader cannot leave out, with a clause on what to write instead.
        has_text: whether the reader uses the text of the element.
    """

    used: tuple[str, ...] = ()
    children: Mapping[str, ElementRule] = field(default_factory=dict)
    without_effect: tuple[str, ...] = ()
    left_out: Mapping[str, LeftOut] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    has_text: bool = False


NAMESPACES = ("@xmlns", "@xmlns:", "@xml:", "@xsi:")
"""Attributes about the document itself, without effect anywhere; `@xml:` stands for its whole namespace."""

_QUATERNION = "write the quaternion as quat_xyzw of URDF 1.1"
_MISPLACED = "it must stand directly in <robot>"

ORIGIN = ElementRule(
    used=("@xyz", "@rpy", "@quat_xyzw"),
    refused=dict.fromkeys(("@quat", "@quat_wxyz", "@quaternion", "@wxyz"), _QUATERNION),
)

INERTIAL = ElementRule(
    children={
        "origin": ORIGIN,
        "mass": ElementRule(used=("@value",)),
        "inertia": ElementRule(used=("@ixx", "@ixy", "@ixz", "@iyy", "@iyz", "@izz")),
    }
)

LINK = ElementRule(
    used=("@name",),
    children={"inertial": INERTIAL},
    without_effect=(
        *("@type", "visual", "collision"),
        *("collision_checking", "self_collision_checking", "self_filter", "contact", "surface", "sensor"),
    ),
    left_out={
        "gravity": LeftOut(neutral=("true", "1")),
        "kinematic": LeftOut(neutral=("false", "0")),
        "origin": LeftOut(neutral=ZERO),
    },
    refused={"link": _MISPLACED, "joint": _MISPLACED},
)

_SOFT_LIMITS = LeftOut("soft limits (<safety_controller>)")
_END = ElementRule(used=("@link",))

JOINT = ElementRule(
    used=("@name", "@type"),
    children={
        "origin": ORIGIN,
        "parent": _END,
        "child": _END,
        "axis": ElementRule(used=("@xyz",), left_out={"@rpy": LeftOut(neutral=ZERO)}),
        "dynamics": ElementRule(
            used=("@damping",),
            left_out={
                "@friction": LeftOut("dry friction", ZERO),
                **dict.fromkeys(
                    ("@K", "@D", "@mu_coulomb", "@mu_viscous", "@spring_stiffness", "@spring_reference"),
                    LeftOut(neutral=ZERO),
                ),
            },
        ),
        "limit": ElementRule(
            used=("@lower", "@upper", "@velocity", "@effort"),
            left_out=dict.fromkeys(
                ("@acceleration", "@deceleration", "@jerk", "@drake:acceleration"), LeftOut(neutral=("inf",))
            ),
        ),
        "mimic": ElementRule(used=("@joint", "@multiplier", "@offset")),
        "safety_controller": ElementRule(
            left_out={"@soft_lower_limit": _SOFT_LIMITS, "@soft_upper_limit": _SOFT_LIMITS},
            without_effect=("@k_position", "@k_velocity"),
        ),
    },
    without_effect=("@dont_collapse", "hardwareInterface"),
    left_out={
        "calibration": LeftOut("reference position (<calibration>)"),
        **dict.fromkeys(("drake:rotor_inertia", "drake:gear_ratio"), LeftOut()),
    },
    refused={"link": _MISPLACED, "joint": _MISPLACED},
)

REDUCTIONS = ("mechanicalReduction", "mechanical_reduction")
"""Words for a gear reduction in ROS control and in ros2_control; as attributes in files for the PR2."""

_REDUCTION = dict.fromkeys(REDUCTIONS, ElementRule(has_text=True))
_REDUCTION_ATTRIBUTES = tuple(f"@{word}" for word in REDUCTIONS)
_INTERFACES = ("hardwareInterface", "role", "@role", "command_interface", "state_interface", "param")

TRANSMISSION = ElementRule(
    used=("@type",),
    children={
        **dict.fromkeys(("type", "plugin"), ElementRule(has_text=True)),
        **_REDUCTION,
        "joint": ElementRule(
            used=("@name", *_REDUCTION_ATTRIBUTES),
            children=_REDUCTION,
            without_effect=(
                *_INTERFACES,
                *("saturationLower", "saturationUpper", "deadBandLower", "deadBandUpper"),
                "ignoreTransmissionAbsoluteEncoder",
            ),
            left_out={"offset": LeftOut(neutral=ZERO)},
        ),
        "actuator": ElementRule(
            used=_REDUCTION_ATTRIBUTES,
            children=_REDUCTION,
            without_effect=("@name", *_INTERFACES),
            left_out={"motorTorqueConstant": LeftOut(), "offset": LeftOut(neutral=ZERO)},
        ),
    },
    without_effect=(
        *("@name", "robotNamespace", "param", "leftActuator", "rightActuator", "flexJoint", "rollJoint"),
        *("gap_joint", "passive_joint", "use_simulated_gripper_joint", "compensator"),
    ),
)
"""A transmission; one that is not from one motor to one joint is named as a whole."""

SPRINGS = ("springStiffness", "springReference")

GAZEBO = ElementRule(
    used=("@reference",),
    without_effect=(
        *("material", "visual", "collision", "sensor", "plugin", "selfCollide", "self_collide"),
        *("mu1", "mu2", "fdir1", "kp", "kd", "maxVel", "minDepth", "maxContacts", "laserRetro"),
        *("stopCfm", "stopErp", "stopKp", "stopKd", "cfmDamping", "implicitSpringDamper", "fudgeFactor"),
        *("provideFeedback", "preserveFixedJoint", "disableFixedJointLumping", "initial_joint_position"),
        *("canonicalBody", "enable_wind", "static", "controller:", "sensor:"),
    ),
    left_out={
        **dict.fromkeys(SPRINGS, LeftOut(f"spring parallel to the drive (<{SPRINGS[0]}>)")),
        "gravity": LeftOut(neutral=("true", "1")),
        "turnGravityOff": LeftOut(neutral=("false", "0")),
        "kinematic": LeftOut(neutral=("false", "0")),
        "dampingFactor": LeftOut(neutral=ZERO),
        **dict.fromkeys(("link", "joint", "model", "include", "axis", "physics"), LeftOut()),
    },
)

ROBOT = ElementRule(
    used=("@name", "@version"),
    children={
        "link": LINK,
        "joint": JOINT,
        "transmission": TRANSMISSION,
        "gazebo": GAZEBO,
        "ros2_control": ElementRule(
            children={"transmission": TRANSMISSION},
            without_effect=("@name", "@type", "@rw_rate", "hardware", "joint", "sensor", "gpio", "param"),
        ),
    },
    without_effect=("material", "sensor", "self_collision_checking", "collision_checking"),
    left_out={"mujoco": LeftOut()},
)

MISSPELLED = 0.8
"""Similarity from which an unknown word is a misspelled one.

It is 0.92 of `@orgin` to `@origin`, and 0.78 of `@gear_velocity`, a word of its own, to `@velocity`.
"""

_ZERO_NUMBER = re.compile(r"[+-]?(0+\.?0*|\.0+)(e[+-]?\d+)?")


class Unread:
    """What the reader does not take from a file.

    Attributes:
        left_out: properties that are not taken over, a phrase and a value each, by the names of joints.
    """

    def __init__(self, file: str, root: Element) -> None:
        names = (joint.attributes.get("name", "").strip() for joint in root.children_with_tag("joint"))
        self.left_out: dict[str, list[tuple[str, str]]] = {name: [] for name in names}
        self._file = file
        self._warnings: dict[str, tuple[str, list[int]]] = {}

    def warn(self, line: int, message: str, kind: str = "") -> None:
        """Note a warning; of several of one kind, or with the same message, the first is shown."""
        self._warnings.setdefault(kind or message, (message, []))[1].append(line)

    def warnings(self) -> Iterator[Problem]:
        """Yield the warnings, of each kind the first one with the number of others."""
        for message, (first, *further) in self._warnings.values():
            more = f" (and {len(further)} more below)" if further else ""
            yield Problem(self._file, first, message + more)


def sort_words(root: Element, unread: Unread, problems: Problems) -> None:
    """Note the words of a file that the reader does not use: as left out, as warnings, or as problems."""
    for joint, element, rule in _elements_with_rules(root, ROBOT, ""):
        for phrase in _describe_omissions(element, rule):
            if joint in unread.left_out:
                unread.left_out[joint].append((f"{phrase} left out", ""))
            else:
                unread.warn(element.line, f"{phrase} is left out")
        for word, line, _ in _words_with_lines(element):
            if refusal := _describe_refusal(word, element, rule, problems.file):
                problems.add(line, refusal)
            elif _is_unknown(word, rule):
                unread.warn(line, f"unknown {_name_subject(word, element)} is ignored")
        if element.text and not rule.has_text:
            unread.warn(element.line, f"text of <{element.tag}> is ignored")


def _elements_with_rules(
    element: Element, rule: ElementRule, joint: str
) -> Iterator[tuple[str, Element, ElementRule]]:
    """Yield elements that are read, each with the name of the joint that it is about, and its rule."""
    named = next(element.children_with_tag("joint"), element) if rule is TRANSMISSION else element
    joint = named.attributes.get({"joint": "name", "gazebo": "reference"}.get(named.tag, ""), joint).strip()
    yield joint, element, rule
    for child in element.children:
        if child.tag in rule.children:
            yield from _elements_with_rules(child, rule.children[child.tag], joint)


def _words_with_lines(element: Element) -> Iterator[tuple[str, int, str]]:
    """Yield each word in an element, its line, and its value or content."""
    yield from ((f"@{name}", element.line, text) for name, text in element.attributes.items())
    for child in element.children:
        yield child.tag, child.line, " ".join([child.text, *child.attributes.values()])


def _quote_word(word: str) -> str:
    """Return a word as it stands in messages."""
    return quoted(word[1:]) if word.startswith("@") else f"<{quoted(word)[1:-1]}>"


def _name_subject(word: str, element: Element) -> str:
    kind = "attribute" if word.startswith("@") else "element"
    return f"{kind} {_quote_word(word)} of <{element.tag}>"


def _is_unknown(word: str, rule: ElementRule) -> bool:
    """Return whether neither a word nor its namespace is in a list."""
    listed = (*rule.used, *rule.children, *rule.without_effect, *rule.left_out, *rule.refused, *NAMESPACES)
    return word not in listed and word[: word.find(":") + 1] not in listed


def _describe_omissions(element: Element, rule: ElementRule) -> Iterator[str]:
    """Yield phrases on words that a robot file cannot express, unless they say as much as none."""
    phrases = {
        word: rule.left_out[word].phrase
        for word, _, text in _words_with_lines(element)
        if word in rule.left_out and not _is_neutral(text, rule.left_out[word].neutral)
    }
    yield from filter(None, phrases.values())
    if bare := [word for word, phrase in phrases.items() if not phrase]:
        names = (word[1:] if word.startswith("@") else _quote_word(word) for word in bare)
        yield f"{', '.join(names)} of <{element.tag}>"


def _is_neutral(text: str, neutral: tuple[str, ...]) -> bool:
    words = text.lower().split()
    return bool(words) and all(
        word in neutral or (neutral == ZERO and _ZERO_NUMBER.fullmatch(word)) for word in words
    )


def _describe_refusal(word: str, element: Element, rule: ElementRule, file: str) -> str:
    """Return why a word must not be ignored; empty if it may be."""
    if word in rule.refused:
        return f"{_name_subject(word, element)} is not read; {rule.refused[word]}"
    if not _is_unknown(word, rule):
        return ""
    if near := difflib.get_close_matches(word.lower(), [*rule.used, *rule.children], n=1, cutoff=MISSPELLED):
        return f"unknown {_name_subject(word, element)}; did you mean {_quote_word(near[0])}?"
    if _may_be_a_macro(word, element, rule):
        reason = "may stand for links, joints or masses, as a macro that was not expanded"
        return f"unknown {_name_subject(word, element)} {reason}; {expansion(file)}, or remove it"
    return ""


def _may_be_a_macro(word: str, element: Element, rule: ElementRule) -> bool:
    """Return whether an unknown element is beside links and joints, has some, or is in place of a mass."""
    inner = {part.tag for child in element.children_with_tag(word) for part in child.with_descendants()}
    in_place_of_mass = rule is LINK and not any(element.children_with_tag("inertial"))
    return bool(inner) and (
        rule is ROBOT
        or in_place_of_mass
        or (rule in (LINK, JOINT) and not inner.isdisjoint(("link", "joint")))
    )


MACRO = re.compile(r"\$\{|\$\((anon|arg|dirname|env|eval|find|optenv)\b")
"""Beginning of an xacro expression; names may contain other dollar signs."""

MESH = "filename"
"""Attribute that names a mesh, which is never opened."""


def refuse_macros(root: Element, problems: Problems) -> None:
    """Report tags and expressions of xacro; its namespace is allowed, since expanded files keep it.

    Raises:
        InputError: there is one.
    """
    for element in root.with_descendants():
        macros = [_quote_word(element.tag)] if element.tag.startswith("xacro:") else []
        values = (word for name, word in element.attributes.items() if name != MESH)
        macros += [quoted(word) for word in values if MACRO.search(word)]
        for macro in macros:
            problems.fail(element.line, f"{macro} belongs to a xacro file; {expansion(problems.file)}")


def expansion(file: str) -> str:
    """Return the advice to expand a xacro file, with the command."""
    name = PurePath(file).name
    stem = name.split(".")[0]
    urdf = f"{stem}.urdf" if name != f"{stem}.urdf" else f"{stem}_expanded.urdf"
    return f"expand it first: xacro {shlex.quote(file)} > {shlex.quote(urdf)}"
