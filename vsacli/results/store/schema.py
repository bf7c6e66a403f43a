"""Layout of the result file, in addition to the declarations of its variables."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np

from vsacli.base.arrays import FLAG_TYPE
from vsacli.base.flags import FLAG_BITS
from vsacli.base.units import Quantity, WrenchQuantity
from vsacli.base.variables import Variable

EXISTING = "existing"
"""Attribute of variables that depend on devices of the joints: 1 for each column that a joint has."""

TEXT = h5py.string_dtype("utf-8")

DOUBLE = "double"
FLOATS: dict[str, np.dtype[Any]] = {DOUBLE: np.dtype("<f8"), "single": np.dtype("<f4")}
"""Storage types of values by precision."""

PRECISION = "precision"
"""Root attribute of files that are not stored in double precision."""


def unit_attributes(quantity: Quantity, joint_types: tuple[str, ...]) -> dict[str, str]:
    """Return `units`; if joints differ in it, or forces and moments, also an attribute for each unit."""
    if isinstance(quantity, WrenchQuantity):
        return quantity.attributes
    units = sorted({quantity.unit(joint_type) for joint_type in joint_types})
    if len(units) == 1:
        return {"units": units[0]}
    return {
        "units": "see joint_type",
        "units_revolute": quantity.revolute,
        "units_prismatic": quantity.prismatic,
    }


def variable_attributes(variable: Variable, joint_types: tuple[str, ...]) -> dict[str, Any]:
    """Return HDF5 attributes of a variable: units, long_name, equation, CF's for coordinates and flags."""
    attributes: dict[str, Any] = unit_attributes(variable.quantity, joint_types)
    attributes |= {"long_name": variable.long_name, "equation": variable.equation}
    if "joint" in variable.dims:
        attributes["coordinates"] = "joint_type"
    if flags := FLAG_BITS.get(variable.name):
        attributes["flag_masks"] = np.array([int(flag) for flag in flags], dtype=FLAG_TYPE)
        attributes["flag_meanings"] = " ".join(flag.label for flag in flags)
    return attributes


def storage_type(variable: Variable, precision: str = DOUBLE) -> np.dtype[Any]:
    """Return the little-endian type of a variable in a file of some precision; times are always double."""
    if variable.name in FLAG_BITS:
        return np.dtype(FLAG_TYPE).newbyteorder("<")
    return FLOATS[precision if variable.dims else DOUBLE]


def storable(text: str) -> str:
    """Return a text that HDF5 can store: bytes that are not UTF-8 (e.g. in a path) and NUL are escaped."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("\0", "\\0")
