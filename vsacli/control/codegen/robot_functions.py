"""The functions that are generated for a robot: link torques and inverse dynamics."""

from __future__ import annotations

from vsacli.base.flags import finite, not_finite_flags
from vsacli.base.signals import POSITION
from vsacli.base.variables import VARIABLES
from vsacli.control.codegen.interface import Array, Function, Rows, Structure
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.dynamics.inverse import InverseDynamics
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
    """(36)-(74)."""
    kernel = InverseDynamics(robot)

    def compute(rows: Rows) -> Rows:
        computed = kernel.results.unpack(kernel(rows))
        return [row for name in DRIVE_NAMES for row in computed[name]]

    return Function(
        name="inverse_dynamics",
        meaning="Motor torques that execute a command; returns the flags of all joints, 0 if all is well.",
        arguments=(("command", command_structure(robot)),),
        result=Structure(
            "drive",
            "What the motors have to do; NaN where a flag says it cannot be.",
            _arrays(robot, DRIVE_NAMES),
        ),
        compute=compute,
    )


def _arrays(robot: Robot, names: tuple[str, ...]) -> tuple[Array, ...]:
    return tuple(variable_array(robot, name) for name in names)


def variable_array(robot: Robot, name: str) -> Array:
    """The array of a result variable."""
    variable = VARIABLES[name]
    motors = (2,) if "motor" in variable.dims else ()
    units = dict.fromkeys(variable.quantity.unit(joint_type) for joint_type in robot.joint_types)
    meaning = ", ".join([variable.long_name, *([] if name == "flags" else [" or ".join(units)])])
    return Array(name, (len(robot.joints), *motors), meaning, bits=name == "flags")
