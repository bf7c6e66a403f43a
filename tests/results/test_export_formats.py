"""Results as MATLAB file, Parquet and JointTrajectory, read back by the readers of others."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import yaml
from pyarrow import parquet
from samples.joint_trajectory import check_message, nanoseconds
from samples.marks import slow_but
from samples.results import STORED, python, random_block, write_result
from scipy.io import loadmat

from vsacli.base.errors import InputError
from vsacli.base.variables import Block
from vsacli.results.exports import FORMATS, formats, selection
from vsacli.results.exports.result_format import UndefinedSamplesError, export_result
from vsacli.results.store.reader import StoredResult

SAMPLES, FEW = 241, 40
MOTION = ["q", "dq", "ddq", "tau_e"]


@pytest.fixture
def stored(tmp_path):
    """Store a block of joints, one a letter, and open it; closed at the end of the test."""
    opened = []

    def store(block, kinds="RP"):
        opened.append(StoredResult.open(write_result(tmp_path / f"{len(opened)}.h5", block, kinds)))
        return opened[-1]

    yield store
    for result in opened:
        result.close()


def exported(result, name, *arguments, **options):
    """The content of the file."""
    form = FORMATS[name]
    stream = io.BytesIO() if form.binary else io.StringIO()
    export_result(result, stream, form, *arguments, **options)
    stream.seek(0)
    return stream


def without(block, name, *where):
    values = getattr(block, name).copy()
    for place in where:
        values[place] = np.nan
    return Block(**{**block.arrays(), name: values})


ALL = sorted(set(STORED) - {"time"})


def test_matlab_reads_every_variable_bit_for_bit(stored):
    block = random_block(SAMPLES, 2)
    content = loadmat(exported(stored(block), "mat", ALL))
    for name in ALL:
        np.testing.assert_array_equal(content[name], getattr(block, name), err_msg=name)
        assert content[name].dtype == getattr(block, name).dtype
    np.testing.assert_array_equal(content["time"], block.time[:, None])


def test_matlab_has_names_and_units_as_cell_arrays(stored):
    content = loadmat(exported(stored(random_block(5, 2)), "mat", ["tau_motor", "wrench"]))
    assert [cell.item() for cell in content["joint_names"][:, 0]] == ["j0", "j1"]
    assert [cell.item() for cell in content["joint_types"][:, 0]] == ["revolute", "prismatic"]
    units = content["units"][0, 0]
    assert units["time"].item() == "s"
    assert [cell.item() for cell in units["tau_motor"][:, 0]] == ["N m", "N"]
    assert [cell.item() for cell in units["wrench"][:, 0]] == ["N"] * 3 + ["N m"] * 3


def test_names_of_variables_are_names_of_matlab():
    """Letters, digits and underscores, at most 63, no keyword: `namelengthmax` and `iskeyword`."""
    for name in [*STORED, *(f"{name}_shaft" for name in STORED)]:
        assert name.isidentifier()
        assert name[0].isalpha()
        assert len(name) <= 63


def test_a_variable_that_is_too_large_for_matlab_is_refused_before_anything_is_written(stored, monkeypatch):
    monkeypatch.setattr(formats, "MAX_VARIABLE_BYTES", 8 * 2 * SAMPLES)
    result = stored(random_block(SAMPLES, 2))
    exported(result, "mat", ["q"])
    with pytest.raises(InputError, match=r"tau_motor has 7,712 bytes, .* below 2 GB; take a lower --rate"):
        exported(result, "mat", ["q", "tau_motor"])
    exported(result, "mat", ["q", "tau_motor"], rate=250)


def test_parquet_has_the_columns_of_the_csv_bit_for_bit(stored):
    block = random_block(SAMPLES, 2)
    table = parquet.read_table(exported(stored(block), "parquet", ["q", "tau_motor", "wrench", "flags"]))
    header = exported(stored(block), "csv", ["q", "tau_motor", "wrench", "flags"]).readline()
    assert ",".join(table.column_names) == header.strip()
    np.testing.assert_array_equal(table["time"], block.time)
    np.testing.assert_array_equal(table["j1.q"], block.q[:, 1])
    np.testing.assert_array_equal(table["j0.tau_motor_2"], block.tau_motor[:, 0, 1])
    assert table["j1.flags"].to_pylist() == block.flags[:, 1].tolist()
    assert str(table.schema.field("j1.flags").type) == "uint32"


def test_parquet_says_units_and_where_it_comes_from(stored):
    schema = parquet.read_schema(exported(stored(random_block(5, 2)), "parquet", ["tau_motor", "wrench"]))
    columns = ("j0.tau_motor_2", "j1.tau_motor_1", "fx", "mz", "time")
    units = {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names}
    assert [units[name] for name in columns] == ["N m", "N", "N", "N m", "s"]
    assert schema.metadata == {b"robot_name": b"two", b"trajectory_name": b"swing", b"verdict": b"ok"}


def test_parquet_comes_in_groups_of_rows(stored, monkeypatch):
    monkeypatch.setattr(selection, "MAX_BLOCK_VALUES", 200)
    file = parquet.ParquetFile(exported(stored(random_block(SAMPLES, 2)), "parquet"))
    assert file.num_row_groups == 5
    assert file.read().num_rows == SAMPLES


@pytest.mark.parametrize("read", [json.loads, yaml.safe_load])
def test_a_joint_trajectory_is_the_message_in_json_and_in_yaml(stored, read):
    block = random_block(FEW, 2)
    odd = np.tile([5e-324, -0.0, 1.7976931348623157e308, 1e22, 1e-5, -1.5e-300, 3.0], FEW)[: 2 * FEW]
    block = Block(**{**block.arrays(), "dq": odd.reshape(FEW, 2), "time": block.time + 0.25})
    message = read(exported(stored(block), "joint-trajectory").read())
    check_message(message)
    assert message["joint_names"] == ["j0", "j1"]
    fields = {"positions": "q", "velocities": "dq", "accelerations": "ddq", "effort": "tau_e"}
    for field, name in fields.items():
        values = np.array([point[field] for point in message["points"]])
        assert values.tobytes() == np.ascontiguousarray(getattr(block, name)).tobytes(), name
    times = [nanoseconds(point["time_from_start"]) for point in message["points"]]
    assert times == [1_000_000 * step for step in range(FEW)]


def test_a_joint_trajectory_leaves_out_fields_that_are_not_asked_for(stored):
    message = json.loads(exported(stored(random_block(3, 2)), "joint-trajectory", ["q", "tau_e"]).read())
    check_message(message)
    assert set(message["points"][0]) == {"positions", "effort", "time_from_start"}


@pytest.mark.parametrize(
    ("variables", "match"),
    [
        (["q", "tau_motor", "phi"], r"cannot hold phi, tau_motor; it holds q, dq, ddq and tau_e"),
        (["dq"], "needs positions: add q to --variables"),
    ],
)
def test_variables_without_a_field_are_refused(stored, variables, match):
    with pytest.raises(InputError, match=match):
        exported(stored(random_block(3, 2)), "joint-trajectory", variables)


@pytest.mark.parametrize("name", FORMATS)
def test_infinity_is_refused(stored, name):
    block = random_block(9, 2)
    block.q[7, 1] = np.inf
    with pytest.raises(UndefinedSamplesError, match=r"j1\.q is infinite at 1 sample, first at t = 0\.007 s"):
        exported(stored(block), name, ["q"])


def test_times_beyond_the_seconds_of_a_message_are_refused(stored):
    block = random_block(9, 2)
    block.time[8] = 3e9
    with pytest.raises(
        InputError, match=r"lasts 3e\+09 s, and a JointTrajectory counts seconds up to 2147483647"
    ):
        exported(stored(block), "joint-trajectory", ["q"])


@pytest.mark.parametrize("name", FORMATS)
def test_a_lower_rate_takes_every_nth_sample(stored, name):
    result = stored(random_block(SAMPLES, 2))
    times = {
        "csv": lambda file: np.loadtxt(file, delimiter=",", skiprows=1)[:, 0],
        "mat": lambda file: loadmat(file)["time"][:, 0],
        "parquet": lambda file: parquet.read_table(file)["time"].to_numpy(),
        "joint-trajectory": lambda file: [
            nanoseconds(point["time_from_start"]) / 1e9 for point in json.load(file)["points"]
        ],
    }
    np.testing.assert_array_equal(times[name](exported(result, name, rate=250)), result.time[::4])


@pytest.mark.parametrize("name", FORMATS)
def test_undefined_samples_are_refused(stored, name):
    result = stored(without(random_block(SAMPLES, 2), "q", (30, 1)))
    with pytest.raises(UndefinedSamplesError, match=r"j1\.q has no value at 1 sample"):
        exported(result, name, ["q"])


def test_undefined_samples_on_request(stored):
    block = without(random_block(SAMPLES, 2), "q", (30, 1), (31, 0))
    result = stored(block)
    np.testing.assert_array_equal(loadmat(exported(result, "mat", ["q"], allow_nan=True))["q"], block.q)
    table = parquet.read_table(exported(result, "parquet", ["q"], allow_nan=True))
    assert (table["j0.q"].null_count, table["j1.q"].null_count) == (1, 1)
    assert table["j1.q"][30].as_py() is None
    with pytest.raises(
        InputError,
        match="--allow-nan cannot be used with joint-trajectory, which cannot represent missing values",
    ):
        exported(result, "joint-trajectory", ["q"], allow_nan=True)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize(("samples", "joints"), [(1, 1), (7, 20)])
def test_one_sample_and_twenty_joints(stored, name, samples, joints):
    result = stored(random_block(samples, joints), "R" * joints)
    content = exported(result, name, ["q"])
    widths = {
        "csv": lambda file: len(file.readline().split(",")) - 1,
        "mat": lambda file: loadmat(file)["q"].shape[1],
        "parquet": lambda file: len(parquet.read_table(file).column_names) - 1,
        "joint-trajectory": lambda file: len(json.load(file)["points"][samples - 1]["positions"]),
    }
    assert widths[name](content) == joints


@pytest.mark.parametrize("name", ["csv", "mat", "parquet"])
def test_the_times_alone(stored, name):
    exported(stored(random_block(5, 2)), name, ["time"])


FULL = """
import io, resource, sys
from vsacli.base.errors import StorageError
from vsacli.base.outputs import Outputs
from vsacli.results.exports import FORMATS
from vsacli.results.exports.result_format import export_result
from vsacli.results.store.reader import StoredResult

form = FORMATS[sys.argv[1]]
with StoredResult.open("r.h5") as result:
    export_result(result, io.BytesIO() if form.binary else io.StringIO(), form)  # imports what it needs
resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, 5_000))
try:
    with (
        StoredResult.open("r.h5") as result,
        Outputs() as outputs,
    ):
        file = outputs.file("out")
        with file.opened(binary=form.binary) as stream:
            export_result(result, stream, form)
except StorageError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(["parquet"], FORMATS))
def test_a_full_disk_leaves_no_file(tmp_path, name):
    write_result(tmp_path / "r.h5", random_block(SAMPLES, 2))
    output, errors = python(FULL, name, folder=tmp_path).communicate()
    assert errors == ""
    assert output.startswith("out: cannot be written: the file would exceed the largest file size allowed")
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
