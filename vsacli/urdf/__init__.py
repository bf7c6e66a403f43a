"""From URDF files: a serial chain as a robot file with standard Denavit-Hartenberg rows."""

from vsacli.urdf.conversion import Conversion, convert
from vsacli.urdf.drives import Placeholders
from vsacli.urdf.report_text import render
from vsacli.urdf.robot_text import robot_text, write_robot

__all__ = ["Conversion", "Placeholders", "convert", "render", "robot_text", "write_robot"]
