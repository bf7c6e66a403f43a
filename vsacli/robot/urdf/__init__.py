"""Import of URDF files: a chain or tree of joints as a robot file with standard Denavit-Hartenberg rows."""

from vsacli.robot.urdf.conversion import Conversion, import_urdf
from vsacli.robot.urdf.placeholders import Placeholders
from vsacli.robot.urdf.robot_text import converted_robot_text

__all__ = ["Conversion", "Placeholders", "converted_robot_text", "import_urdf"]
