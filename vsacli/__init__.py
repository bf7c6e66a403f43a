"""Inverse dynamics of robots with variable stiffness actuators (VSA-NEA, Buondonno & De Luca 2016).

What users import is what the rooms offer; the block below is read by type checkers and, when a name is first
asked for, by `lazy_exports`, so that the command line starts without NumPy.
"""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.actuators import *
    from vsacli.analysis import *
    from vsacli.base import *
    from vsacli.control import *
    from vsacli.dynamics import *
    from vsacli.robot import *
    from vsacli.studies import *
    from vsacli.trajectory import *

__getattr__, __dir__ = lazy_exports(__name__)
