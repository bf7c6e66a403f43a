"""Results of trees: wrenches by tool in files and exports, and the geometry that is read back."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import xarray
from samples.results import REPORT, PlannedTrajectory, robot, writing
from samples.shipped import shipped_robot
from samples.torso import FRAMES, SWING, torso, torso_result

from vsacli import InputError, Pose, Result, Tool, inverse_dynamics, load_trajectory, open_result
from vsacli.base.variables import VARIABLES, Block, Variable, column_names, row_shape
from vsacli.base.wrench import WRENCH_AXES
from vsacli.results.charts.stored import StoredCharts
from vsacli.results.store.excerpt import Excerpt
from vsacli.results.store.reader import open_stored
from vsacli.robot.kinematics import Geometry, frames_in_base

TOOLS = ("left_hand", "right_hand", "lamp")
PUSHES = np.array([*range(1, 7), *[0] * 6, *range(13, 19)], dtype=float)
"""Components of the wrenches of the torso."""

UNITS_OF_COMPLIANCE = [["m/N"] * 3 + ["m/(N m)"] * 3] * 3 + [["rad/N"] * 3 + ["rad/(N m)"] * 3] * 3
"""Units of displacements, then of rotations, by forces and moments."""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return torso_result(tmp_path_factory.mktemp("torso"))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory, result: Result) -> Path:
    path = tmp_path_factory.mktemp("stored") / "swing.h5"
    result.save(path)
    return path


@pytest.mark.slow
def test_wrench_has_a_dimension_of_tools(result, path):
    assert result.wrench.shape == (41, 3, 6)
    assert np.array_equal(result.wrench[0].ravel(), PUSHES)
    with h5py.File(path) as file:
        assert file.attrs["format"] == "vsacli-result/3"
        assert [list(dim.keys()) for dim in file["wrench"].dims] == [["time"], ["tool"], ["wrench_axis"]]
        assert tuple(file["tool"].asstr()) == TOOLS
        assert tuple(frame or None for frame in file["tool"].attrs["wrench_frame"]) == FRAMES
        assert file["wrench"].attrs["long_name"] == "wrench exerted on each tool"
    with open_result(path) as stored:
        stored.check()
        assert np.array_equal(stored.wrench, result.wrench)
        assert stored.to_xarray().identical(result.to_xarray())
    with xarray.open_dataset(path, engine="h5netcdf") as dataset:
        of_lamp = dataset.wrench.sel(tool="lamp", wrench_axis="mz")
        assert np.array_equal(of_lamp, result.wrench[:, 2, 5])


def corners(geometry: Geometry, q: np.ndarray) -> np.ndarray:
    """Axes and origins of all frames."""
    base, *parts = frames_in_base(geometry, q)
    frames = [frame for part in parts for frame in part]
    columns = [np.concatenate([frame.axes, frame.origin[..., None]], axis=-1) for frame in frames]
    return np.array([*columns, np.concatenate([base.axes, np.zeros((len(q), 3, 1))], axis=-1)])


def test_geometry_is_read_back(result, path):
    with open_stored(path) as stored:
        geometry = stored.geometry()
    assert geometry.joints[1].mount == Pose(xyz=(0.0, 0.2, 0.0), rpy=(-np.pi / 2, 0.0, 0.0))
    assert [row.mount is None for row in geometry.joints] == [
        True,
        False,
        True,
        True,
        False,
        True,
        True,
        False,
    ]
    assert np.array_equal(corners(geometry, result.q), corners(result.robot, result.q))


@pytest.mark.parametrize("member", ["wrong", "waist"])
def test_damaged_parents(path, tmp_path, member):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        file["inputs/robot/joints/parent"][0] = member
    with open_stored(copy) as stored, pytest.raises(InputError, match="is damaged or truncated"):
        stored.geometry()


def test_exports_name_the_tools(path, vsacli):
    assert vsacli("export", path, "--variables", "wrench,dwrench,q", "-o", "swing.csv").code == 0
    with open("swing.csv", newline="") as file:
        header, first, *_ = csv.reader(file)
    assert header[9:27] == [f"{tool}.{axis}" for tool in TOOLS for axis in WRENCH_AXES]
    assert header[27:33] == [f"left_hand.d{axis}" for axis in WRENCH_AXES]
    assert [float(value) for value in first[9:27]] == PUSHES.tolist()
    assert vsacli("export", path, "--variables", "wrench", "-o", "swing.mat").code == 0
    exported = scipy.io.loadmat("swing.mat", simplify_cells=True)
    assert exported["wrench"].shape == (41, 3, 6)
    assert exported["tool_names"].tolist() == list(TOOLS)
    assert exported["units"]["wrench"].tolist() == [["N"] * 3 + ["N m"] * 3] * 3


def test_parquet_names_the_tools(path, vsacli):
    parquet = pytest.importorskip("pyarrow.parquet")
    assert vsacli("export", path, "--variables", "wrench", "-o", "swing.parquet").code == 0
    table = parquet.read_table("swing.parquet")
    assert table.column_names[1:3] == ["left_hand.fx", "left_hand.fy"]
    assert table.schema.field("lamp.mz").metadata == {b"unit": b"N m"}


def test_charts_name_the_tools(path):
    with open_stored(path) as stored:
        charts = StoredCharts([Excerpt(stored, ["pole"])]).charts_of("wrench")
    assert [chart.title for chart in charts[:3]] == [
        "wrench exerted on each tool, forces on left_hand",
        "wrench exerted on each tool, moments on left_hand",
        "wrench exerted on each tool, forces on right_hand",
    ]
    assert [line.label for line in charts[5].lines] == ["mx", "my", "mz"]
    assert [line.curve.values[0] for line in charts[5].lines] == [16.0, 17.0, 18.0]


def test_some_joints_of_a_tree_have_its_wrenches_but_no_compliance(tmp_path):
    inverse_dynamics(*torso(tmp_path), tip_compliance=True).save(tmp_path / "soft.h5")
    with open_stored(tmp_path / "soft.h5") as stored:
        names = ("wrench", "tip_compliance", "tool_flags")
        for joints, shown in (((), names), (("pole",), names[:1])):
            part = Excerpt(stored, joints)
            assert tuple(name for name in names if part.has_variable(part.declared[name])) == shown


def test_info_names_the_tools(path, vsacli):
    described = json.loads(vsacli("info", path, "--json").out)
    assert described["tools"] == list(TOOLS)
    assert {"time", "tool", "wrench_axis"} == {
        dim for variable in described["variables"] if "wrench" in variable["name"] for dim in variable["dims"]
    }
    assert "tools left_hand, right_hand, lamp" in vsacli("info", path).out.splitlines()


def test_a_tool_of_a_chain_needs_no_dimension(tmp_path, vsacli):
    """A robot with one entry in `tools` has the wrench of a chain, in the version for trees."""
    chain = shipped_robot("vsa_3r")
    named = dataclasses.replace(chain, tools=(Tool(name="grip", joint=chain.joint_names[1]),))
    (tmp_path / "held.yaml").write_text(
        f"{SWING}wrench: {{type: constant, frame: base, value: [1, 2, 3, 4, 5, 6]}}\n"
    )
    result = inverse_dynamics(named, load_trajectory(tmp_path / "held.yaml", named))
    result.save("held.h5")
    with h5py.File("held.h5") as file:
        assert file.attrs["format"] == "vsacli-result/3"
        assert [list(dim.keys()) for dim in file["wrench"].dims] == [["time"], ["wrench_axis"]]
        assert file["wrench"].attrs["long_name"] == "wrench exerted on the end effector"
    with open_result("held.h5") as stored:
        stored.check()
        assert stored.tool_names == ("grip",)
        np.testing.assert_array_equal(stored.wrench, np.tile(np.arange(1.0, 7.0), (41, 1)))
        assert stored.to_xarray().identical(result.to_xarray())
    assert vsacli("export", "held.h5", "--variables", "wrench", "-o", "held.csv").code == 0
    assert Path("held.csv").read_text().startswith("time,fx,fy,fz,mx,my,mz\n")


@pytest.mark.parametrize("shape", ["tree", "chain"])
def test_variables_of_tools_are_stored_and_exported(result, vsacli, shape):
    of = robot() if shape == "chain" else result.robot
    tools, rng = len(of.tool_names), np.random.default_rng(1)
    compliance = rng.normal(size=(5, tools, 6, 6))
    flags = rng.integers(0, 4, (5, tools)).astype(np.uint32)
    samples = Block(time=np.arange(5.0), tip_compliance=compliance, tool_flags=flags)
    names = ("tip_compliance", "tool_flags")
    with writing(Path("tools.h5"), of, PlannedTrajectory(5), names) as writer:
        writer.write(samples)
        writer.finish(REPORT)
    with open_stored("tools.h5") as stored:
        stored.check()
        assert np.array_equal(stored.read("tip_compliance"), compliance)
        assert np.array_equal(stored.read("tool_flags"), flags)
        assert stored.tool_names == (("end_effector",) if shape == "chain" else TOOLS)
        assert stored.attributes["format"] == f"vsacli-result/{2 if shape == 'chain' else 3}"
    assert vsacli("export", "tools.h5", "--variables", ",".join(names), "-o", "tools.csv").code == 0
    with open("tools.csv", newline="") as file:
        header, first, *_ = csv.reader(file)
    assert header[1] == f"{of.tool_names[0]}.tip_compliance_x_fx"
    assert header[-1] == f"{of.tool_names[-1]}.tool_flags"
    assert [float(value) for value in first[1:-tools]] == compliance[0].ravel().tolist()
    assert vsacli("export", "tools.h5", "--variables", ",".join(names), "-o", "tools.mat").code == 0
    exported = scipy.io.loadmat("tools.mat", simplify_cells=True)
    assert np.array_equal(exported["tip_compliance"].reshape(compliance.shape), compliance)
    units = exported["units"]["tip_compliance"].reshape(tools, 6, 6)
    assert units.tolist() == [UNITS_OF_COMPLIANCE] * tools
    described = json.loads(vsacli("info", "tools.h5", "--json").out)["variables"]
    assert described[0]["dims"] == ["time", "tool", "displacement_axis", "wrench_axis"]


def test_variables_with_any_dimensions():
    labels = {
        "joint": ("a",),
        "tool": ("left", "right"),
        "displacement_axis": ("x", "rx"),
        "wrench_axis": ("fx",),
    }
    dims = ("tool", "displacement_axis", "wrench_axis")
    variable = Variable("tip_compliance", dims, VARIABLES["q"].quantity, "", "")
    assert row_shape(variable, labels) == (2, 2, 1)
    assert column_names(variable, labels) == [
        "left.tip_compliance_x_fx",
        "left.tip_compliance_rx_fx",
        "right.tip_compliance_x_fx",
        "right.tip_compliance_rx_fx",
    ]
    assert column_names(variable._replace(name="tool_flags", dims=("tool",)), labels) == [
        "left.tool_flags",
        "right.tool_flags",
    ]
