"""Export to MJCF, the XML format of MuJoCo: links with the motors and springs that move them.

The frame of a body is the Denavit-Hartenberg frame of its link, so that center of mass and inertia have the
same values as in the robot file. The model contains nothing that is not in the equations of motion: no
contact, no enforced limit, no constraint.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

from vsacli.base.version import __version__
from vsacli.robot.joint import Joint, Pose
from vsacli.robot.model import Robot
from vsacli.robot.models.exported_model import (
    Element,
    ExportedModel,
    add_element,
    arm_length,
    exported_tool_names,
    rod_radius,
    set_attributes,
    xml_document,
)
from vsacli.robot.models.mjcf_drives import (
    GHOST,
    POINT_SIZE,
    Sections,
    Start,
    add_dampers,
    add_drive,
    add_start,
    check_bodies,
    draw_rod,
    full_inertia,
)
from vsacli.robot.models.passive_forces import check_friction, forces_text, forces_words

LOWEST_VERSION = "3.7"
"""Lowest version of MuJoCo: the first with springs whose torque is a polynomial. Tested with 3.5, 3.6, 3.7
and 4.0."""

TIME_STEP = 1e-3
"""Time step, s; if torques are given at each stage, the motion of the bundled 3R is 4e-13 rad off with it."""

SEEN = 2
"""Size of the initial view, as a multiple of the length of the arm."""

LINK_COLOR = (0.35, 0.45, 0.6, 1)


def mjcf_model(robot: Robot, start: Start | None = None) -> ExportedModel:
    """Return the model, with a key frame if the start of a motion is given.

    Raises:
        InputError: MuJoCo does not support a link or friction of the robot; or the start is undefined.
    """
    check_bodies(robot)
    check_friction(robot)
    root = ElementTree.Element("mujoco", model=robot.name)
    add_element(root, "compiler", angle="radian")
    option = add_element(root, "option", gravity=robot.gravity, integrator="RK4", timestep=TIME_STEP)
    add_element(option, "flag", contact="disable")
    add_element(root, "statistic", center=robot.base.xyz, extent=SEEN * arm_length(robot))
    _add_light(root)
    sections = Sections(*(add_element(root, tag) for tag in ("worldbody", "tendon", "actuator")))
    bodies = {-1: _add_body(sections.world, "base", robot.base)}
    radius = rod_radius(robot)
    for index, (joint, parent) in enumerate(zip(robot.joints, robot.parents, strict=True)):
        below = _add_mount(bodies[parent], joint, radius)
        bodies[index] = _add_link_body(below, joint, radius)
        add_drive(sections, joint, below, bodies[index])
    add_dampers(sections, robot.joints)
    tools = zip(exported_tool_names(robot), robot.end_effectors, robot.tool_joints, strict=True)
    for name, tool, carrier in tools:
        add_element(bodies[carrier], "site", name=name, pos=tool.xyz, quat=_quaternion(tool), size=POINT_SIZE)
    if start is not None:
        add_start(root, sections.world, robot, start)
    return ExportedModel(xml_document(root, _header_comment(robot)), forces_text(robot), ())


def _add_light(root: Element) -> None:
    """Add a bright sky, against which a model without a ground is visible."""
    add_element(add_element(root, "visual"), "headlight", ambient=(0.4, 0.4, 0.4), diffuse=(0.6, 0.6, 0.6))
    sky = add_element(
        add_element(root, "asset"), "texture", type="skybox", builtin="gradient", width=64, height=384
    )
    set_attributes(sky, rgb1=(0.85, 0.9, 0.95), rgb2=(1, 1, 1))


def _header_comment(robot: Robot) -> str:
    words = forces_words(robot)
    beside = f" In addition, passive forces: {words}." if words else ""
    return f"{robot.name}, by vsacli {__version__}, for MuJoCo {LOWEST_VERSION} or later.{beside}"


def _add_body(parent: Element, name: str, pose: Pose) -> Element:
    return add_element(parent, "body", name=name, pos=pose.xyz, quat=_quaternion(pose))


def _add_mount(parent: Element, joint: Joint, radius: float) -> Element:
    """Return the body at which the row of a joint begins: a new one for a mount, drawn with a rod to it."""
    if joint.mount is None:
        return parent
    if math.hypot(*joint.mount.xyz) > radius:
        draw_rod(parent, joint.mount.xyz, radius, LINK_COLOR)
    return _add_body(parent, f"{joint.name}.mount", joint.mount)


def _add_link_body(parent: Element, joint: Joint, radius: float) -> Element:
    """Add the body of a link at its pose at q = 0, with its joint, and return it."""
    dh, link = joint.dh, joint.link
    sa, ca = math.sin(dh.alpha), math.cos(dh.alpha)
    place = (dh.a * math.cos(dh.theta), dh.a * math.sin(dh.theta), dh.d)
    body = add_element(parent, "body", name=f"{joint.name}.link", pos=place, quat=_row_quaternion(joint))
    add_element(body, "inertial", pos=link.com, mass=link.mass, fullinertia=full_inertia(link))
    origin = (-dh.a, -dh.d * sa, -dh.d * ca)
    hinge = add_element(
        body,
        "joint",
        name=joint.name,
        type="hinge" if joint.is_revolute else "slide",
        axis=(0.0, sa, ca),
        pos=origin,
        damping=joint.damping,
    )
    if all(map(math.isfinite, joint.limits.position)):
        set_attributes(hinge, range=joint.limits.position, limited=False)
    _draw_link(body, origin, radius)
    return body


def _draw_link(body: Element, origin: tuple[float, float, float], radius: float) -> None:
    if math.hypot(*origin) > radius:
        draw_rod(body, origin, radius, LINK_COLOR)
    else:
        add_element(body, "geom", type="sphere", size=radius, rgba=LINK_COLOR, **GHOST)


def _row_quaternion(joint: Joint) -> tuple[float, ...]:
    """Return the quaternion of Rz(theta) Rx(alpha)."""
    (ct, st), (ca, sa) = (_half_angle_cosine_sine(angle) for angle in (joint.dh.theta, joint.dh.alpha))
    return (ct * ca, ct * sa, st * sa, st * ca)


def _quaternion(pose: Pose) -> tuple[float, ...]:
    """Return the quaternion of Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = map(_half_angle_cosine_sine, pose.rpy)
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


def _half_angle_cosine_sine(angle: float) -> tuple[float, float]:
    return math.cos(angle / 2), math.sin(angle / 2)
