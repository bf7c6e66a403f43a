"""Variables with the names of their dimensions, for xarray, which is optional."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from vsacli.base.arrays import AnyArray
from vsacli.base.variables import MOTORS, VARIABLES
from vsacli.base.wrench import WRENCH_AXES
from vsacli.results.store.schema import variable_attributes

if TYPE_CHECKING:
    import xarray


def labelled_dataset(
    arrays: Mapping[str, AnyArray], joint_names: Sequence[str], joint_types: tuple[str, ...]
) -> xarray.Dataset:
    """The dataset that xarray makes of a result file with these variables.

    Args:
        arrays: variables by name, each (samples, ...) with the dimensions that are declared for it.
        joint_names: base to tip.
        joint_types: "revolute" or "prismatic".

    Raises:
        ModuleNotFoundError: xarray is not installed.
    """
    try:
        import xarray
    except ModuleNotFoundError:
        reason = "to_xarray needs the package xarray, which is not installed; pip install xarray gets it"
        raise ModuleNotFoundError(reason, name="xarray") from None
    labels = {"joint": list(joint_names), "motor": list(MOTORS), "wrench_axis": list(WRENCH_AXES)}
    variables = {}
    for name, array in arrays.items():
        attributes = variable_attributes(VARIABLES[name], joint_types)
        attributes.pop("coordinates", None)  # xarray knows them
        variables[name] = (("time", *VARIABLES[name].dims), array, attributes)
    used = {dim for dims, _, _ in variables.values() for dim in dims}
    coordinates = {name: label for name, label in labels.items() if name in used}
    return xarray.Dataset(variables, {**coordinates, "joint_type": ("joint", list(joint_types))})
