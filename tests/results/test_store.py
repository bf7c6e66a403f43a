"""The result file: what is in it, and that anything that reads HDF5 can read it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import warnings
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import h5py
import numpy as np
import pytest
import xarray
from samples.marks import slow
from samples.results import (
    REPORT,
    SOURCE,
    STORED,
    PlannedTrajectory,
    part,
    random_block,
    robot,
    write_result,
    writing,
)

from vsacli import Flag, InputError, laws
from vsacli.base.outputs import Staged
from vsacli.base.units import POSITION
from vsacli.documents.fields import number
from vsacli.documents.source import Source
from vsacli.results.store.layout import resolve
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.writer import ResultWriter

SAMPLES = 250


@pytest.fixture(scope="module")
def block():
    return random_block(SAMPLES, 2)


@pytest.fixture(scope="module")
def path(tmp_path_factory, block):
    return write_result(
        tmp_path_factory.mktemp("store") / "run.h5", block, provenance={"command_line": "vsacli invdyn é"}
    )


def datasets(file):
    found = {}
    file.visititems(lambda name, node: found.update({name: node}) if isinstance(node, h5py.Dataset) else None)
    return found


def everything_with_a_type(file):
    """(place, HDF5 type) of every dataset and attribute but those that link dimension scales."""
    nodes = [file]
    file.visititems(lambda _, node: nodes.append(node))
    for node in nodes:
        if isinstance(node, h5py.Dataset):
            yield node.name, node.id.get_type()
        for name in set(node.attrs) - {"DIMENSION_LIST", "REFERENCE_LIST"}:
            yield f"{node.name}@{name}", node.attrs.get_id(name).get_type()


def test_every_value_comes_back_bit_for_bit_with_h5py_alone(path, block):
    with h5py.File(path) as file:
        for name in STORED:
            np.testing.assert_array_equal(file[name][...], getattr(block, name), strict=True)


def test_root_attributes(path):
    with h5py.File(path) as file:
        attributes = dict(file.attrs)
    assert next(iter(attributes)) == "format"
    assert attributes["format"] == "vsacli-result/2"
    assert attributes["generated_by"].startswith("vsacli ")
    assert attributes["command_line"] == "vsacli invdyn é"
    assert set(json.loads(attributes["versions"])) == {"vsacli", "python", "numpy", "scipy", "h5py"}
    assert (attributes["robot_name"], attributes["trajectory_name"]) == ("two", "swing")
    assert (attributes["verdict"], attributes["complete"]) == ("ok", 1)
    assert attributes["Conventions"] == "CF-1.11"


def test_created_is_the_present_time_in_utc(path):
    with h5py.File(path) as file:
        created = datetime.fromisoformat(file.attrs["created"])
    assert created.utcoffset() == timedelta(0)
    # the module's file is written at most minutes before this test runs
    assert timedelta(0) <= datetime.now(UTC) - created < timedelta(hours=1)


def test_variables_have_their_declared_attributes(path):
    with h5py.File(path) as file:
        for name, variable in STORED.items():
            attributes = file[name].attrs
            assert attributes["long_name"] == variable.long_name
            assert attributes["equation"] == variable.equation
            assert attributes["units"]


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ("RR", {"units": "N m"}),
        ("PP", {"units": "N"}),
        ("RP", {"units": "see joint_type", "units_revolute": "N m", "units_prismatic": "N"}),
    ],
)
def test_units_follow_the_joint_types(tmp_path, block, kinds, expected):
    with h5py.File(write_result(tmp_path / "r.h5", block, kinds)) as file:
        attributes = file["tau_motor"].attrs
        assert {key: attributes[key] for key in attributes if key.startswith("units")} == expected
        assert file["time"].attrs["units"] == "s"
        assert file["flags"].attrs["units"] == "1"


def test_flags_explain_themselves_as_cf_asks(path):
    with h5py.File(path) as file:
        attributes = file["flags"].attrs
        assert attributes["flag_masks"].dtype == file["flags"].dtype == np.uint32
        assert attributes["flag_masks"].tolist() == [2**bit for bit in range(15)]
        assert attributes["flag_meanings"].split() == [flag.label for flag in Flag]


def test_a_scale_is_attached_to_every_axis(path):
    scale_of = {}
    with h5py.File(path) as file:
        for name, dataset in datasets(file).items():
            if dataset.is_scale:
                assert dataset.attrs["NAME"].decode() == name.split("/")[-1]
                continue
            for length, axis in zip(dataset.shape, dataset.dims, strict=True):
                assert len(axis) == 1, name
                assert axis[0].shape == (length,), name
            scale_of[name] = [axis[0].name for axis in dataset.dims]
    assert scale_of["tau_motor"] == ["/time", "/joint", "/motor"]
    assert scale_of["flags"] == ["/time", "/joint"]
    assert scale_of["joint_type"] == ["/joint"]
    assert scale_of["inputs/robot/joints/link_com"] == ["/joint", "/inputs/robot/axis"]


def test_no_type_that_matlab_or_netcdf_cannot_read(path):
    with h5py.File(path) as file:
        types = dict(everything_with_a_type(file))
        classes = {kind.get_class() for kind in types.values()}
        assert classes == {h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING}
        for place, kind in types.items():
            # CLASS and NAME are HDF5's own marks of a dimension scale
            if kind.get_class() == h5py.h5t.STRING and not place.endswith(("@CLASS", "@NAME")):
                assert kind.is_variable_str(), place
                assert kind.get_cset() == h5py.h5t.CSET_UTF8, place


def test_floats_are_plain_and_flags_compressed(path):
    with h5py.File(path) as file:
        assert file["tau_motor"].compression is None
        assert file["flags"].compression == "gzip"


@pytest.mark.parametrize(("joints", "samples"), [(1, 100), (3, 4001), slow(7, 400_000), slow(1000, 5000)])
def test_chunks_hold_about_half_a_megabyte_or_less(tmp_path, joints, samples):
    path = tmp_path / "r.h5"
    with writing(path, robot("R" * joints), PlannedTrajectory(samples)) as writer:
        writer.write(random_block(1, joints))
        writer.finish(REPORT)
    with h5py.File(path) as file:
        for name in STORED:
            size = np.prod(file[name].chunks) * file[name].dtype.itemsize
            assert size <= 2**19
            # not needlessly small either, and the last one is as full as the others, but for its last rows
            chunks = -(-samples // file[name].chunks[0])
            assert 2 * size > 2**19 or chunks == 1
            assert chunks * file[name].chunks[0] - samples < chunks


@pytest.mark.slow
def test_xarray_opens_it_with_named_coordinates_and_no_warning(path, block):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_dataset(path, engine="h5netcdf") as data:
            data.load()
    assert data.tau_motor.dims == ("time", "joint", "motor")
    assert set(data.coords) == {"time", "joint", "motor", "joint_type", "wrench_axis"}
    assert data.time.dtype == np.float64
    one = data.tau_motor.sel(joint="j1", motor=2)
    np.testing.assert_array_equal(one, block.tau_motor[:, 1, 1])
    assert one.joint_type == "prismatic"


@pytest.mark.slow
def test_xarray_opens_single_precision(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block, precision="single")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        np.testing.assert_array_equal(data.time, block.time, strict=True)
        np.testing.assert_array_equal(data.theta, block.theta.astype(np.float32), strict=True)


@pytest.mark.slow
def test_xarray_opens_the_groups_too(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            joints = tree["inputs/robot/joints"].dataset.load()
    assert joints.link_com.sel(joint="j1", axis="z") == 1.3


@pytest.mark.slow
def test_blocks_of_any_size_give_the_same_file(tmp_path, block, chunks):
    chunks(2**11)  # several chunks in 250 samples

    def contents(step):
        with h5py.File(write_result(tmp_path / f"{step}.h5", block, step=step)) as file:
            assert file["tau_motor"].chunks == (63, 2, 2)
            return {
                name: (dataset.shape, dataset.chunks, np.asarray(dataset[()]).tolist())
                for name, dataset in datasets(file).items()
            }

    assert contents(SAMPLES) == contents(7) == contents(64)


@pytest.mark.slow
def test_a_run_that_ends_early_keeps_the_steps_so_far(tmp_path, block):
    path = tmp_path / "r.h5"
    with writing(path, robot(), PlannedTrajectory(10_000)) as writer:
        writer.write(part(block, 0, 120))
        writer.finish({**REPORT, "verdict": "infeasible", "complete": False})
    with StoredResult.open(path) as result:
        assert result.samples == 120
        assert result.complete is False
        assert result.verdict == "infeasible"
        np.testing.assert_array_equal(result.read("theta"), block.theta[:120])
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.sizes["time"] == 120


def test_a_selection_is_stored_with_its_coordinates(tmp_path, block):
    with h5py.File(write_result(tmp_path / "r.h5", block, variables=["flags", "tau_motor"])) as file:
        assert list(file) == [
            "time",
            "joint",
            "joint_type",
            "motor",
            "tau_motor",
            "flags",
            "inputs",
            "report",
        ]


def test_an_unknown_variable_is_refused_before_anything_is_written(tmp_path):
    path = tmp_path / "r.h5"
    with pytest.raises(InputError, match="no variable is called 'tau_motr'; did you mean 'tau_motor'"):
        ResultWriter(Staged(path, path, path), robot(), PlannedTrajectory(1), ["tau_motr"])
    assert list(tmp_path.iterdir()) == []


def test_the_report_is_stored_as_its_json_text(path):
    with h5py.File(path) as file:
        assert json.loads(file["report/json"].asstr()[()]) == {**REPORT, "samples": SAMPLES}


def test_files_that_were_read_are_stored_once_each(tmp_path, block):
    text = "name: swing\n"
    motion = Source("swing.yaml", hashlib.sha256(text.encode()).hexdigest(), text)
    noise = Source("motion\udcff.csv", "f" * 64, None)
    trajectory = PlannedTrajectory(SAMPLES, sources=(motion, noise, noise, SOURCE))
    with writing(tmp_path / "r.h5", robot(), trajectory) as writer:
        writer.write(block)
        writer.finish(REPORT)
    with h5py.File(tmp_path / "r.h5") as file:
        inputs = file["inputs"]
        assert sorted(inputs) == ["file_1", "file_2", "file_3", "robot"]
        assert [inputs[f"file_{k}"].attrs["path"] for k in (1, 2, 3)] == [
            SOURCE.path,
            "swing.yaml",
            r"motion\udcff.csv",
        ]
        assert inputs["file_2"].attrs["sha256"] == motion.sha256
        assert inputs["file_2/text"].asstr()[()] == text
        assert "text" not in inputs["file_3"]


def test_text_that_hdf5_cannot_hold_is_escaped(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block, provenance={"command_line": "vsacli a\udcff\0b"})
    with StoredResult.open(path) as result:
        assert result.attributes["command_line"] == r"vsacli a\udcff\0b"


def test_the_robot_is_stored_as_arrays_of_its_declared_fields(path):
    with h5py.File(path) as file:
        joints = file["inputs/robot/joints"]
        assert file["inputs/robot/gravity"][...].tolist() == [0, 0, -9.81]
        assert file["inputs/robot/gravity"].attrs["units"] == "m/s^2"
        assert joints["link_mass"][...].tolist() == [1.5, 2.5]
        assert joints["link_com"][...].tolist() == [[0.1, 0.2, 0.3], [0.1, 0.2, 1.3]]
        assert joints["link_inertia_xy"][...].tolist() == [0.01, 0.01]
        assert joints["dh_a"][...].tolist() == [0, 0.1]
        assert joints["actuator_type"].asstr()[...].tolist() == ["antagonistic"] * 2
        assert joints["actuator_motor_inertia"][...].tolist() == [[3.2, 3.3], [3.2, 4.3]]
        assert joints["actuator_motor_inertia"].attrs["units_prismatic"] == "kg"
        assert joints["actuator_motor_max_torque"][...].tolist() == [[90, np.inf]] * 2
        assert joints["actuator_spring_type"].asstr()[...].tolist() == [["cubic"] * 2] * 2
        assert joints["actuator_spring_k"][...].tolist() == [[400, 440], [401, 440]]
        assert joints["limits_position"][...].tolist() == [[-1, 2]] * 2
        assert joints["limits_stiffness"][...].tolist() == [[-np.inf, np.inf]] * 2


@dataclass(frozen=True)
class Hooke(laws.Cubic):
    reach: float = number(POSITION, "a field that the cubic law lacks")


def test_joints_with_different_fields_share_the_arrays(monkeypatch):
    monkeypatch.setitem(laws.LAWS.homes, "hooke", f"{__name__}:Hooke")
    mixed = robot()
    odd = dataclasses.replace(
        mixed.joints[0].actuator, spring=(Hooke(k=1, k_c=1, reach=0.5), laws.Cubic(k=2, k_c=2))
    )
    first = dataclasses.replace(mixed.joints[0], actuator=odd)
    mixed = dataclasses.replace(mixed, joints=(first, mixed.joints[1]))
    fields = {"_".join(field.path): field for field in resolve(mixed)}
    assert fields["joints_actuator_spring_type"].values.tolist() == [["hooke", "cubic"], ["cubic", "cubic"]]
    reach = fields["joints_actuator_spring_reach"]
    assert reach.dims == ("joint", "motor")
    np.testing.assert_array_equal(reach.values, [[0.5, np.nan], [np.nan, np.nan]])


def test_reading(path, block):
    with StoredResult.open(path) as result:
        assert result.joint_names == ("j0", "j1")
        assert result.joint_types == ("revolute", "prismatic")
        assert (result.robot_name, result.trajectory_name, result.verdict) == ("two", "swing", "ok")
        assert result.complete is True
        assert result.samples == SAMPLES
        assert result.report_json["warnings"] == ["µ: –"]
        assert result.variables == tuple(name for name in STORED if name != "time")
        np.testing.assert_array_equal(result.time, block.time)
        np.testing.assert_array_equal(result.read("phi", 20, 30), block.phi[20:30], strict=True)
        np.testing.assert_array_equal(result.read("flags", 200), block.flags[200:], strict=True)
