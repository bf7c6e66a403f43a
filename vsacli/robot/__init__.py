"""The robot: its joints and links, its file, its kinematics, and import from URDF."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.robot.compliance import tip_compliance
    from vsacli.robot.file import load_robot
    from vsacli.robot.joint import DenavitHartenberg, Inertia, Joint, Limits, Link, Pose, Tool
    from vsacli.robot.kinematics import forward_kinematics, jacobian
    from vsacli.robot.model import Robot
    from vsacli.robot.urdf import Placeholders, import_urdf

__all__ = [
    "DenavitHartenberg",
    "Inertia",
    "Joint",
    "Limits",
    "Link",
    "Placeholders",
    "Pose",
    "Robot",
    "Tool",
    "forward_kinematics",
    "import_urdf",
    "jacobian",
    "load_robot",
    "tip_compliance",
]
__getattr__, __dir__ = lazy_exports(__name__)
