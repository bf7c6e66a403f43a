"""Inverse dynamics of robots with variable stiffness actuators (VSA-NEA, Buondonno & De Luca 2016).

Users import the names that the packages offer. The block below is read by type checkers and, at the first use
of a name, by `lazy_exports`, so that the command line starts without NumPy.
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
