"""`vsacli export`: a robot as URDF and MJCF."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import h5py
import pytest
from samples.command_line import REPOSITORY, ROBOT, contents

ROBOTS = REPOSITORY / "robots"


def test_a_model_goes_to_standard_output_or_to_a_file(vsacli, tmp_path):
    printed = vsacli("export", ROBOT, "--format", "mjcf")
    assert (printed.code, printed.err) == (0, "")
    written = vsacli("export", ROBOT, "--format", "mjcf", "-o", "arm.xml")
    assert (written.code, written.out, written.err) == (0, "", "wrote arm.xml\n")
    assert (tmp_path / "arm.xml").read_text(encoding="utf-8") == printed.out
    assert ElementTree.parse(tmp_path / "arm.xml").getroot().get("model") == "vsa-3r"


def test_forces_that_mjcf_has_no_place_for_are_beside_it(vsacli, tmp_path):
    robot = ROBOTS / "awas_1r.yaml"
    done = vsacli("export", robot, "--format", "mjcf")
    assert (done.code, done.out) == (2, "")
    assert done.err.endswith("this model includes a Python file with forces; give -o FILE\n")
    done = vsacli("export", robot, "--format", "mjcf", "-o", "a.b.xml")
    assert (done.code, done.err) == (0, "wrote a.b.xml\nwrote a.b_forces.py\n")
    assert "In addition, passive forces: springs of elbow." in (tmp_path / "a.b.xml").read_text()


USING = """
import mujoco, runpy
other = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
)
model = mujoco.MjModel.from_xml_path("awas.xml")
data = mujoco.MjData(model)
runpy.run_path("awas_forces.py")["install"](model)
data.qpos[:] = [0, 0.1, 5]
mujoco.mj_forward(model, data)
print(data.qfrc_passive.round(3).tolist())
its = mujoco.MjData(other)
mujoco.mj_step(other, its)
print(its.qfrc_passive.tolist())
"""


@pytest.mark.slow
def test_the_forces_act_on_their_model_alone_and_need_nothing_of_vsacli(vsacli, tmp_path):
    pytest.importorskip("mujoco")
    vsacli("export", ROBOTS / "awas_1r.yaml", "--format", "mjcf", "-o", "awas.xml")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", USING + "import sys; assert 'vsacli' not in sys.modules"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    torque, other = done.stdout.splitlines()
    r, phi = 0.05, 0.1
    tau_e, against_setting = 120000 * r**2 * math.sin(phi) * math.cos(phi), 1200 * r * math.sin(phi) ** 2
    assert json.loads(torque) == [round(each, 3) for each in (tau_e, -tau_e, -against_setting)]
    assert other == "[0.0]"


@pytest.mark.slow
def test_the_start_of_a_result_is_a_key_frame(vsacli, tmp_path, feasible_result):
    done = vsacli("export", ROBOT, "--format", "mjcf", "--start", feasible_result, "-o", "arm.xml")
    assert (done.code, done.err) == (0, "wrote arm.xml\n")
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    with h5py.File(feasible_result) as result:
        theta = result["theta"][0].ravel()
    places = [
        model.joint(f"{joint}.motor_{motor}").qposadr[0]
        for joint in ("base", "shoulder", "elbow")
        for motor in (1, 2)
    ]
    assert model.key("start").qpos[places].tolist() == theta.tolist()


def test_a_start_that_cannot_be(vsacli, tmp_path, feasible_result):
    other = ROBOTS / "rp_2.yaml"
    done = vsacli("export", other, "--format", "mjcf", "--start", feasible_result)
    assert done.code == 2
    assert "is of another robot, with the joints base, shoulder, elbow, not" in done.err
    done = vsacli("export", ROBOT, "--format", "urdf", "--start", feasible_result)
    assert done.err.endswith("Error: --start is only for --format mjcf; leave it out\n")
    done = vsacli("export", feasible_result, "--start", feasible_result)
    assert done.err.endswith("Error: --start is only for MJCF of a robot; leave it out\n")
    assert contents(tmp_path) == {}


def test_a_urdf_comes_back(vsacli, tmp_path):
    done = vsacli("export", ROBOT, "--format", "urdf", "-o", "arm.urdf")
    assert done.code == 0
    assert done.err.splitlines() == [
        "wrote arm.urdf",
        "motors and springs are left out: URDF has no place for them (base, shoulder, elbow)",
    ]
    assert vsacli("import-urdf", "arm.urdf").code == 0
    assert (tmp_path / "arm.yaml").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "is a robot; choose its"),
        (["--format", "csv"], "--format csv is for results; a robot is written as urdf or mjcf"),
        (["--format", "urdf", "--rate", "100"], "--rate is only for results; leave it out"),
        (["--format", "urdf", "--allow-nan"], "--allow-nan is only for results"),
    ],
)
def test_what_is_not_for_robots_is_refused(vsacli, arguments, message):
    done = vsacli("export", ROBOT, *arguments)
    assert (done.code, done.out) == (2, "")
    assert message in done.err


def test_other_files_are_refused(vsacli, feasible_result, motion):
    done = vsacli("export", feasible_result, "--format", "urdf")
    assert done.code == 2
    assert "--format urdf is for robots; a result is written as csv, mat, parquet or joint-traj" in done.err
    done = vsacli("export", motion)
    assert done.err == (
        f"{motion}: is a trajectory; export needs a result, a simulation or a robot; "
        f"compute it first: vsacli invdyn ROBOT {motion}\n"
    )


def test_a_link_that_mujoco_refuses_is_named_and_nothing_is_written(vsacli, tmp_path):
    done = vsacli("export", ROBOTS / "puma_560.yaml", "--format", "mjcf", "-o", "puma.xml")
    assert (done.code, done.out) == (2, "")
    waist, elbow = done.err.splitlines()
    assert waist.startswith(f"{ROBOTS / 'puma_560.yaml'}: link of joint waist: MuJoCo takes no body without")
    assert "link of joint elbow: its inertia breaks the triangle inequality (0.086 > 0.0125 + 0.066" in elbow
    assert contents(tmp_path) == {}


def test_files_that_exist_are_kept(vsacli, tmp_path):
    (tmp_path / "awas_forces.py").write_text("precious")
    done = vsacli("export", ROBOTS / "awas_1r.yaml", "--format", "mjcf", "-o", "awas.xml")
    assert done.code == 4
    assert contents(tmp_path) == {"awas_forces.py": b"precious"}
