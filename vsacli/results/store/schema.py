"""Layout of the result file, as far as the declarations of its variables do not say."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from vsacli.base.flags import Flag
from vsacli.base.units import Quantity, WrenchQuantity
from vsacli.base.variables import MOTORS, Variable
from vsacli.base.wrench import WRENCH_AXES

FORMAT, SIMULATION, SENSITIVITY = "vsacli-result/2", "vsacli-simulation/2", "vsacli-sensitivity/2"
"""Formats of files in the layout of results."""

EXISTING = "existing"
"""Attribute of a variable that depends on devices of the joints: 1 at each column that a joint has."""

TEXT = h5py.string_dtype("utf-8")

DOUBLE = "double"
FLOATS: dict[str, np.dtype[Any]] = {DOUBLE: np.dtype("<f8"), "single": np.dtype("<f4")}
"""Types of values by the precision in which a file stores them."""

PRECISION = "precision"
"""Root attribute of files that do not store values in double precision."""


def unit_attributes(quantity: Quantity, joint_types: tuple[str, ...]) -> dict[str, str]:
    """`units`; if the robot's joints differ in it, or forces and moments do, one more attribute for each."""
    if isinstance(quantity, WrenchQuantity):
        return {
            "units": "see wrench_axis",
            "units_force": quantity.prismatic,
            "units_moment": quantity.revolute,
        }
    found = sorted({quantity.unit(joint_type) for joint_type in joint_types})
    if len(found) == 1:
        return {"units": found[0]}
    return {
        "units": "see joint_type",
        "units_revolute": quantity.revolute,
        "units_prismatic": quantity.prismatic,
    }


def variable_attributes(variable: Variable, joint_types: tuple[str, ...]) -> dict[str, Any]:
    """HDF5 attributes of a variable: units, long_name, equation, and CF's for coordinates and flags."""
    attributes: dict[str, Any] = unit_attributes(variable.quantity, joint_types)
    attributes |= {"long_name": variable.long_name, "equation": variable.equation}
    if "joint" in variable.dims:
        attributes["coordinates"] = "joint_type"
    if variable.name == "flags":
        attributes["flag_masks"] = np.array([int(flag) for flag in Flag], dtype=np.uint32)
        attributes["flag_meanings"] = " ".join(flag.label for flag in Flag)
    return attributes


def storage_type(variable: Variable, precision: str = DOUBLE) -> np.dtype[Any]:
    """Little-endian type of a variable in a file of some precision; times are always double."""
    if variable.name == "flags":
        return np.dtype("<u4")
    return FLOATS[precision if variable.dims else DOUBLE]


def row_shape(variable: Variable, joints: int) -> tuple[int, ...]:
    """Lengths of the axes after time."""
    lengths = {"joint": joints, "motor": len(MOTORS), "wrench_axis": len(WRENCH_AXES)}
    return tuple(lengths[dim] for dim in variable.dims)


def storable(text: str) -> str:
    """Text as HDF5 can hold it: bytes that are not UTF-8 (in a path, say) and NUL become escapes."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("\0", "\\0")
