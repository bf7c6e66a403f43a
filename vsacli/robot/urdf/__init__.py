"""From URDF files: a serial chain as a robot file with standard Denavit-Hartenberg rows."""

from vsacli.actuators.actuator import Placeholders
from vsacli.robot.urdf.conversion import Conversion, import_urdf
from vsacli.robot.urdf.conversion_text import render, robot_text

__all__ = ["Conversion", "Placeholders", "import_urdf", "render", "robot_text"]
