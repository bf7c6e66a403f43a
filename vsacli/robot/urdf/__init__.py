"""From URDF files: a serial chain as a robot file with standard Denavit-Hartenberg rows."""

from vsacli.robot.urdf.conversion import Conversion, convert
from vsacli.robot.urdf.conversion_text import render
from vsacli.robot.urdf.drives import Placeholders
from vsacli.robot.urdf.robot_text import robot_text, write_robot

__all__ = ["Conversion", "Placeholders", "convert", "render", "robot_text", "write_robot"]
