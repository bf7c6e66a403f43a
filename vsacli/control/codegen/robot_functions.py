"""The functions that are generated for a robot: link torques and inverse dynamics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.flags import finite, not_finite_flags
from vsacli.base.signals import POSITION
from vsacli.base.variables import VARIABLES
from vsacli.compute.vector import Scalar
from vsacli.control.codegen.interface import Array, Function, Rows, Structure
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.dynamics.inverse import INTERNAL, InverseDynamics
from vsacli.robot.model import Robot

DRIVE_NAMES = (
    "tau_e",
    "phi",
    "theta",
    "dtheta",
    "ddtheta",
    "tau_motor",
    "stiffness_lower",
    "stiffness_upper",
    "flags",
)
"""Variables that the generated inverse dynamics gives."""


def motion_structure(robot: Robot) -> Structure:
    """Position and its derivatives; damping between the links, if there is any."""
    return Structure(
        "motion", "Motion of the joints.", _arrays(robot, tuple(LinkTorques(robot).arguments.shapes))
    )


def command_structure(robot: Robot) -> Structure:
    """Motion and stiffness."""
    meaning = "Commanded motion and stiffness; only antagonistic and serial joints read a stiffness."
    names = (name for signal in (POSITION, *robot.signals) for name in signal.names)
    return Structure("command", meaning, _arrays(robot, tuple(names)))


def link_torques_function(robot: Robot) -> Function:
    """(36)-(60)."""
    kernel = LinkTorques(robot)

    def compute(rows: Rows) -> Rows:
        torques = kernel(rows)
        of_joints = zip(*kernel.results.unpack(torques).values(), strict=True)
        return [*torques, *(not_finite_flags(~finite(of_joint)) for of_joint in of_joints)]

    return Function(
        name="link_torques",
        meaning=(
            "Torques that the links demand of the joints, and their first two derivatives; returns the flags "
            "of all joints, 0 if all numbers are finite."
        ),
        arguments=(("motion", motion_structure(robot)),),
        result=Structure("torques", "Torques of the joints.", _arrays(robot, (*TORQUES, "flags"))),
        compute=compute,
    )


def inverse_dynamics_function(robot: Robot) -> Function:
    """(36)-(74); what moves inside damped transmissions goes in and, with its rates, comes out."""
    damped = tuple(index for index, joint in enumerate(robot.joints) if joint.damper_at("transmission"))
    kernel = InverseDynamics(robot, internal=damped, driven=True)
    given, inside = command_structure(robot), internal_structure(robot) if damped else None

    def compute(rows: Rows) -> Rows:
        values = given.layout.unpack(rows[: given.layout.size])
        deflections = rows[given.layout.size :]
        values[INTERNAL[0]] = [deflections[SIDES * index + side] for index in damped for side in range(SIDES)]
        named = {name: values[name] for name in kernel.arguments.shapes}
        computed = kernel.results.unpack(kernel(kernel.arguments.pack(named)))
        drive = [row for name in DRIVE_NAMES for row in computed[name]]
        if inside is None:
            return drive
        return [*drive, *_inside(robot, computed, "phi"), *_inside(robot, computed, "dphi")]

    rates = _internal_array(robot, "dinternal_phi", "their rates")
    further = () if inside is None else (*inside.arrays, rates)
    return Function(
        name="inverse_dynamics",
        meaning=(
            "Motor torques that execute a command; returns the flags of all joints, 0 if all is well."
            + (" Between calls integrate internal_phi by dinternal_phi." if inside else "")
        ),
        arguments=(("command", given), *([] if inside is None else [("internal", inside)])),
        result=Structure(
            "drive",
            "What the motors have to do; NaN where a flag says it cannot be.",
            (*_arrays(robot, DRIVE_NAMES), *further),
        ),
        compute=compute,
    )


def internal_structure(robot: Robot) -> Structure:
    """What moves inside damped transmissions: a state that whoever calls keeps."""
    meaning = (
        "State inside transmissions with a damper, whose damping must be positive; other joints do not "
        "count. Start it where the springs carry the joint alone."
    )
    array = _internal_array(robot, "internal_phi", "deflections; theta of a motor that sets springs")
    return Structure("internal", meaning, (array,))


def _internal_array(robot: Robot, name: str, meaning: str) -> Array:
    return Array(name, (len(robot.joints), SIDES), meaning)


def _inside(robot: Robot, computed: Mapping[str, Sequence[Scalar]], name: str) -> Iterator[Scalar]:
    """Deflections, or their rates; of a motor that sets the springs its own position."""
    of_motor = {"phi": "theta", "dphi": "dtheta"}[name]
    for index, joint in enumerate(robot.joints):
        for side, there in enumerate(joint.actuator.has(VARIABLES["phi"])):
            yield computed[name if there else of_motor][SIDES * index + side]


def _arrays(robot: Robot, names: tuple[str, ...]) -> tuple[Array, ...]:
    return tuple(variable_array(robot, name) for name in names)


def variable_array(robot: Robot, name: str) -> Array:
    """The array of a result variable."""
    variable = VARIABLES[name]
    motors = (2,) if "motor" in variable.dims else ()
    units = dict.fromkeys(variable.quantity.unit(joint_type) for joint_type in robot.joint_types)
    meaning = ", ".join([variable.long_name, *([] if name == "flags" else [" or ".join(units)])])
    return Array(name, (len(robot.joints), *motors), meaning, bits=name == "flags")
