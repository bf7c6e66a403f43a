"""Formats of exported results: CSV, MATLAB files, Parquet, JointTrajectory messages; and xarray datasets.

CSV has a column for each joint and variable, with floats that are read back bit for bit. MATLAB files have
version 5, for MATLAB, Octave and SciPy. Parquet has the columns of the CSV. ROS 2 messages
`trajectory_msgs/msg/JointTrajectory` are JSON, written so that YAML readers read the same values: a decimal
point in each mantissa, and ASCII characters only.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import IO, TYPE_CHECKING, Any, TextIO, cast

import numpy as np
import numpy.typing as npt
import scipy

from vsacli.base.arrays import AnyArray
from vsacli.base.errors import InputError
from vsacli.base.variables import VARIABLES, Labels, row_shape, variables_by_tool
from vsacli.results.exports.result_format import ResultFormat
from vsacli.results.exports.selection import ExportSamples, ExportVariable, Selection
from vsacli.results.store.schema import storage_type, variable_attributes

if TYPE_CHECKING:
    import pyarrow
    import xarray


def write_csv(selection: Selection, stream: TextIO, advance: Callable[[int], object]) -> None:
    """Write a header line and a line for each sample; open a file with newline=""."""
    labels = selection.result.labels
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        ["time", *(column for variable in selection.variables for column in variable.columns(labels))]
    )
    for block in selection.blocks():
        columns = [block.time.tolist()]
        for variable in selection.variables:
            columns += _cells(variable.column_values(block.values[variable.name]))
        writer.writerows(zip(*columns, strict=True))
        advance(len(block.time) * len(selection.variables))


def _cells(columns: npt.NDArray[Any]) -> list[list[Any]]:
    """Return columns as numbers; NaN becomes None, which the csv module writes as an empty cell."""
    missing = np.isnan(columns)
    if missing.any():
        columns = columns.astype(object)
        columns[missing] = None
    cells: list[list[Any]] = columns.tolist()
    return cells


CSV = ResultFormat(write_csv, missing="empty cells")


MAX_VARIABLE_BYTES = 2**31 - 2**16
"""Maximum size of a variable: the format counts bytes in 32 bits, readers in 31; less the header."""


def write_mat(selection: Selection, stream: IO[bytes], advance: Callable[[int], object]) -> None:
    """Write `time`, each variable (samples, joints[, 2]), or by tool, and names and units.

    Each variable is read when it is written, so that only one is in memory.
    """
    scipy.io.savemat(
        cast("Any", stream), _Variables(selection, advance), oned_as="column", long_field_names=True
    )


def check_sizes(selection: Selection) -> None:
    """Refuse a variable that is too large for the format."""
    for variable in selection.variables:
        size = len(selection.time) * variable.existing.size * np.dtype(np.float64).itemsize
        if size > MAX_VARIABLE_BYTES:
            reason = (
                f"{variable.name} has {size:,} bytes, and a variable of a MATLAB file of version 5 must stay "
                "below 2 GB; take a lower --rate, or read the result itself, whose variables h5read gives"
            )
            raise InputError.one(reason, selection.result.path)


class _Variables(Mapping[str, Any]):
    """The variables of the file by name, each created on access."""

    def __init__(self, selection: Selection, advance: Callable[[int], object]) -> None:
        tool_entry = {"tool_names": lambda: _cell_array(selection.result.tool_names)}
        by_tool = any("tool" in variable.variable.dims for variable in selection.variables)
        self._readers: dict[str, Callable[[], Any]] = {
            "joint_names": lambda: _cell_array(selection.result.joint_names),
            "joint_types": lambda: _cell_array(selection.result.joint_types),
            **(tool_entry if by_tool else {}),
            "units": lambda: _units(selection),
            "time": lambda: selection.time,
            **{variable.name: _reader(selection, variable, advance) for variable in selection.variables},
        }

    def __getitem__(self, name: str) -> Any:
        return self._readers[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)


def _reader(
    selection: Selection, variable: ExportVariable, advance: Callable[[int], object]
) -> Callable[[], Any]:
    def read() -> Any:
        values = selection.read(variable, 0, len(selection.time))
        advance(len(values))
        return values

    return read


def _cell_array(texts: Sequence[str]) -> Any:
    """Return a cell array with one column of texts."""
    return np.array(texts, dtype=object)[:, None]


def _units(selection: Selection) -> dict[str, Any]:
    """Return the units of each variable by name: one for each joint, or each axis of the wrench, by tool."""
    types, labels = selection.result.joint_types, selection.result.labels
    units = {variable.name: _cell_array(variable.units(types)) for variable in selection.variables}
    for variable in (chosen.variable for chosen in selection.variables if "tool" in chosen.variable.dims):
        units[variable.name] = units[variable.name].reshape(row_shape(variable, labels))
    return {"time": "s", **units}


MAT = ResultFormat(write_mat, binary=True, missing="NaN", check=check_sizes)


RESULT_ATTRIBUTES = ("robot_name", "trajectory_name", "verdict")
"""Attributes of the result that are stored in the metadata of the table."""


def write_parquet(selection: Selection, stream: IO[bytes], advance: Callable[[int], object]) -> None:
    """Write the columns of the CSV in row groups, one of which is in memory at a time."""
    from pyarrow import Table, array, parquet

    schema = _schema(selection)
    with parquet.ParquetWriter(stream, schema) as writer:
        for block in selection.blocks():
            columns = [block.time]
            for variable in selection.variables:
                columns += list(variable.column_values(block.values[variable.name]))
            arrays = [array(column, mask=np.isnan(column)) for column in columns]
            writer.write_table(Table.from_arrays(arrays, schema=schema))
            advance(len(block.time) * len(selection.variables))


def check_installed(_selection: Selection) -> None:
    """Refuse the format if pyarrow is not installed."""
    try:
        import pyarrow  # noqa: F401
    except ModuleNotFoundError:
        reason = "Parquet needs the package pyarrow, which is not installed; pip install pyarrow gets it"
        raise InputError.one(reason) from None


def _schema(selection: Selection) -> pyarrow.Schema:
    import pyarrow

    metadata: dict[Any, Any] = {name: getattr(selection.result, name) for name in RESULT_ATTRIBUTES}
    return pyarrow.schema(
        [
            pyarrow.field(name, pyarrow.from_numpy_dtype(dtype), metadata={"unit": unit})
            for name, dtype, unit in _column_fields(selection)
        ],
        metadata=metadata,
    )


def _column_fields(selection: Selection) -> Iterator[tuple[str, np.dtype[Any], str]]:
    """Yield name, type and unit of each column."""
    result = selection.result
    yield "time", np.dtype(np.float64), "s"
    for variable in selection.variables:
        units = np.repeat(variable.units(result.joint_types), variable.existing.sum(axis=1)).tolist()
        for name, unit in zip(variable.columns(result.labels), units, strict=True):
            yield name, storage_type(variable.variable), unit


PARQUET = ResultFormat(write_parquet, binary=True, missing="nulls", check=check_installed)


FIELDS = {"positions": "q", "velocities": "dq", "accelerations": "ddq", "effort": "tau_e"}
"""Variable in each field of a point. The effort is the torque of the joint on the link, since a joint may
have two motors, whose torques depend on springs that the message cannot describe."""

WITHOUT_POINT = re.compile(r"(?<![\d.])(\d+)e")
"""Regular expression of numbers such as 1e-05, which are numbers in JSON but texts in YAML."""

NANOSECONDS = 10**9
"""Nanoseconds in a second; times of messages are whole seconds and nanoseconds."""

LONGEST = 2**31 - 1
"""Maximum number of seconds in a message: builtin_interfaces/msg/Duration has a signed 32-bit integer."""


def check_fields(selection: Selection) -> None:
    """Refuse variables without a field, a selection without positions, and times that are too long."""
    names = {variable.name for variable in selection.variables}
    without_field = sorted(names - set(FIELDS.values()))
    if without_field:
        *first_names, last_name = FIELDS.values()
        fields_text = f"{', '.join(first_names)} and {last_name}"
        raise InputError.one(
            f"--variables: a JointTrajectory cannot hold {', '.join(without_field)}; it holds {fields_text}"
        )
    if FIELDS["positions"] not in names:
        raise InputError.one(f"a JointTrajectory needs positions: add {FIELDS['positions']} to --variables")
    if selection.time.size and selection.time[-1] - selection.time[0] > LONGEST:
        duration_text = f"lasts {selection.time[-1] - selection.time[0]:.4g} s"
        raise InputError.one(
            f"{duration_text}, and a JointTrajectory counts seconds up to {LONGEST}", selection.result.path
        )


def write_joint_trajectory(selection: Selection, stream: TextIO, advance: Callable[[int], object]) -> None:
    """Write the message, a line for each point; `time_from_start` counts from the first sample."""
    names = json.dumps(list(selection.result.joint_names))
    stream.write('{"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},\n')
    stream.write(f'"joint_names": {names},\n"points": [')
    separator = "\n"
    for block in selection.blocks():
        points = ",\n".join(map(json.dumps, _points(selection, block)))
        stream.write(separator + WITHOUT_POINT.sub(r"\1.0e", points))
        separator = ",\n"
        advance(len(block.time) * len(selection.variables))
    stream.write("\n]}\n")


def _points(selection: Selection, block: ExportSamples) -> Iterator[dict[str, Any]]:
    values = block.values
    columns = {field: values[name].tolist() for field, name in FIELDS.items() if name in values}
    elapsed_ns = np.rint((block.time - selection.time[0]) * NANOSECONDS).astype(np.int64).tolist()
    for point_ns, *point in zip(elapsed_ns, *columns.values(), strict=True):
        seconds, nanoseconds = divmod(point_ns, NANOSECONDS)
        stamp = {"sec": seconds, "nanosec": nanoseconds}
        yield {**dict(zip(columns, point, strict=True)), "time_from_start": stamp}


JOINT_TRAJECTORY = ResultFormat(
    write_joint_trajectory,
    variables=dict.fromkeys(("result", "simulation"), tuple(FIELDS.values())),
    check=check_fields,
)


def labeled_dataset(
    arrays: Mapping[str, AnyArray], labels: Labels, joint_types: tuple[str, ...]
) -> xarray.Dataset:
    """Return the dataset that xarray would read from a result file with these variables.

    Args:
        arrays: variables by name, each (samples, ...) with its declared dimensions.
        labels: labels along each dimension.
        joint_types: types of the joints, "revolute" or "prismatic".

    Raises:
        ModuleNotFoundError: xarray is not installed.
    """
    try:
        import xarray
    except ModuleNotFoundError:
        reason = "to_xarray needs the package xarray, which is not installed; pip install xarray gets it"
        raise ModuleNotFoundError(reason, name="xarray") from None
    declared, variables = variables_by_tool(VARIABLES, len(labels["tool"])), {}
    for name, array in arrays.items():
        attributes = variable_attributes(declared[name], joint_types)
        attributes.pop("coordinates", None)  # xarray derives it from the dataset
        variables[name] = (("time", *declared[name].dims), array, attributes)
    used_dims = {dim for dims, _, _ in variables.values() for dim in dims}
    coordinates = {name: list(label) for name, label in labels.items() if name in used_dims}
    return xarray.Dataset(variables, {**coordinates, "joint_type": ("joint", list(joint_types))})
