"""What users meet in Python: what objects show of themselves, what they do, and what slips are told."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from samples.results import writing
from samples.robots import vsa_3r
from samples.simulated import short_motion

import vsacli
from vsacli import (
    FeedbackLinearization,
    Gains,
    InputError,
    Result,
    Robot,
    State,
    StorageError,
    Trajectory,
    feedback_linearization,
    fixes,
    forward_kinematics,
    import_urdf,
    inverse_dynamics,
    jacobian,
    link_torques,
    load_robot,
    load_trajectory,
    mass_matrix,
    open_result,
    simulate,
    state_derivative,
)

REPOSITORY = Path(__file__).parents[1]
ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"
MOTION = REPOSITORY / "trajectories" / "rest_to_rest.yaml"
SAMPLES = 8


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(ROBOT)


@pytest.fixture(scope="module")
def trajectory(robot: Robot) -> Trajectory:
    return load_trajectory(MOTION, robot)


@pytest.fixture(scope="module")
def result(robot: Robot, trajectory: Trajectory) -> Result:
    return inverse_dynamics(robot, trajectory)


def test_robots_trajectories_and_results_show_what_they_are_in_a_few_lines(
    robot: Robot, trajectory: Trajectory, result: Result
) -> None:
    assert repr(robot).splitlines() == [
        "Robot vsa-3r",
        "joint          type       actuator",
        "base       revolute   antagonistic",
        "shoulder   revolute   antagonistic",
        "elbow      revolute   antagonistic",
    ]
    assert repr(trajectory) == "Trajectory rest-to-rest: 3 joints, 4001 samples, 0 to 4 s"
    shown = repr(result).splitlines()
    assert shown[0] == "Result of vsa-3r, rest-to-rest: 4001 samples, 4 s, ok"
    assert [line.split()[0] for line in shown[1:]] == ["joint", "N", "base", "shoulder", "elbow"]


def test_a_simulation_shows_its_report() -> None:
    simulation = simulate(vsa_3r(), short_motion(3))
    assert repr(simulation) == f"Simulation of {simulation.report}"


def test_notebooks_get_html_in_which_names_are_text(robot: Robot, trajectory: Trajectory) -> None:
    bold = robot.replace("joints.0.name", "base")
    bold = Robot(name="<b>bold</b>", joints=bold.joints)
    assert "<p>Robot &lt;b&gt;bold&lt;/b&gt;</p><table>" in bold._repr_html_()
    assert "<td>antagonistic</td>" in bold._repr_html_()
    trajectory = copy.copy(trajectory)
    trajectory.name = "a<b"
    assert "a&lt;b: 3 joints" in trajectory._repr_html_()
    shown = inverse_dynamics(bold, trajectory)._repr_html_()
    assert "<b>" not in shown
    assert "a&lt;b" in shown


@pytest.mark.slow
def test_a_report_prints_as_the_command_does(result: Result, vsacli_out: str) -> None:
    assert str(result.report) == vsacli_out


@pytest.fixture
def vsacli_out(tmp_path: Path) -> str:
    words = [sys.executable, "-m", "vsacli", "invdyn", "-q", str(ROBOT), str(MOTION), "-o", "a.h5"]
    done = subprocess.run(
        [*words, "--engine", "numpy"], capture_output=True, text=True, check=True,
        cwd=tmp_path, env={"PYTHONPATH": str(Path(vsacli.__file__).parents[1])},
    )  # fmt: skip
    return done.stdout.rstrip("\n")


def test_a_result_is_saved_as_the_command_saves_it(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "result.h5"
    result.save(path)
    with h5py.File(path) as file:
        assert {"time", "joint", "tau_motor", "flags", "inputs", "report"} <= set(file)
        np.testing.assert_array_equal(file["tau_motor"][...], result.tau_motor)
        assert file.attrs["verdict"] == "ok"
        assert len([name for name in file["inputs"] if name.startswith("file_")]) == 2
    with pytest.raises(StorageError, match="exists"):
        result.save(path)
    result.save(str(path), overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["result.h5"]


def test_a_saved_result_is_opened_as_what_it_was(result: Result, tmp_path: Path) -> None:
    result.save(tmp_path / "result.h5")
    with open_result(str(tmp_path / "result.h5")) as opened:
        assert "tau_motor" not in vars(opened)
        np.testing.assert_array_equal(opened.tau_motor, result.tau_motor)
        assert opened.tau_motor is opened.tau_motor
        assert (opened.joint_names, opened.samples) == (result.joint_names, 4001)
        assert repr(opened) == repr(result)
        assert str(opened.report) == str(result.report)
        assert {"tau_motor", "flags", "report"} <= set(dir(opened))
        assert not hasattr(opened, "wrench")
        with pytest.raises(AttributeError, match="has no attribute 'tau'"):
            _ = opened.tau


@pytest.mark.slow
def test_a_variable_that_was_not_stored_is_missed_by_name(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "part.h5"
    with writing(path, result.robot, result.trajectory, ["q"]) as writer:
        writer.write(result)
        writer.finish(result.report.as_json())
    with open_result(path) as opened:
        assert list(opened.arrays()) == ["time", "q"]
        assert list(opened.to_xarray().data_vars) == ["q"]
        with pytest.raises(AttributeError, match="holds no tau_motor; run invdyn again without --variables"):
            _ = opened.tau_motor


def test_a_report_of_another_form_is_refused(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "result.h5"
    result.save(path)
    with h5py.File(path, "r+") as file:
        file["report/json"][()] = '{"verdict": "ok"}'
    with pytest.raises(InputError, match="its report has another form than this version writes"):
        open_result(path)
    path.unlink()  # it was closed


@pytest.mark.slow
def test_figures_are_those_of_the_command(result: Result, tmp_path: Path) -> None:
    names = ["motion", "motor-torque", "elastic-torque", "energy"]
    assert list(result.plot()) == names
    assert not list(tmp_path.iterdir())
    result.plot(tmp_path / "figures", stem="arm")
    drawn = {path.name: path.read_bytes() for path in (tmp_path / "figures").iterdir()}
    assert sorted(drawn) == sorted(f"arm-{name}.png" for name in names)
    result.save(tmp_path / "arm.h5")
    with open_result(tmp_path / "arm.h5") as opened, pytest.raises(StorageError, match="exists"):
        opened.plot(tmp_path / "figures")
    with open_result(tmp_path / "arm.h5") as opened:
        opened.plot(tmp_path / "figures", overwrite=True)
    assert {path.name: path.read_bytes() for path in (tmp_path / "figures").iterdir()} == drawn


@pytest.mark.slow
def test_the_dataset_is_what_xarray_makes_of_the_file(result: Result, tmp_path: Path) -> None:
    result.save(tmp_path / "result.h5")
    with (
        xarray.open_dataset(tmp_path / "result.h5", engine="h5netcdf") as expected,
        open_result(tmp_path / "result.h5") as opened,
    ):
        for dataset in (result.to_xarray(), opened.to_xarray()):
            xarray.testing.assert_equal(dataset, expected)
            assert list(dataset.data_vars) == list(expected.data_vars)
            for name in dataset.data_vars:
                xarray.testing.assert_identical(dataset[name].variable, expected[name].variable)


def test_without_xarray_a_sentence_says_what_to_install(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ModuleNotFoundError, match="xarray, which is not installed; pip install xarray"):
        result.to_xarray()


def test_a_robot_with_other_values_is_a_new_one(robot: Robot) -> None:
    stiffer = robot.replace("joints.elbow.actuator.spring.k", 500)
    assert [spring.k for spring in stiffer.joints[2].actuator.spring] == [500, 500]
    assert [spring.k for spring in robot.joints[2].actuator.spring] == [400, 400]
    moon = robot.replace({"gravity.2": -1.62, "joints.*.damping": 0, "base.rpy": ["90 deg", 0, 0]})
    assert moon.gravity == (0, 0, -1.62)
    assert [joint.damping for joint in moon.joints] == [0, 0, 0]
    assert moon.base.rpy == (np.pi / 2, 0, 0)
    assert type(moon) is Robot
    assert moon.sources == robot.sources


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("joints.elbo.damping", 0, "joints has no 'elbo'; did you mean 'elbow'"),
        ("joints.elbow.mass", 1, r"joints.elbow has no 'mass'"),
        ("joints.elbow.damping", -1, r"joints.elbow.damping: .*-1"),
        ("joints.elbow.damping", "fast", r"joints.elbow.damping: .*fast"),
    ],
)
def test_what_cannot_be_replaced_is_refused(robot: Robot, path: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        robot.replace(path, value)


class TestSlips:
    """Arguments of a wrong kind get a sentence with what was given, what is expected, and the call."""

    TORQUES = np.zeros((3, 2))

    def functions_of_a_robot(self):
        q = np.zeros(3)
        state = State(q, q, self.TORQUES, self.TORQUES)
        yield lambda robot: inverse_dynamics(robot, short_motion(3))
        yield lambda robot: simulate(robot, short_motion(3))
        yield lambda robot: fixes(robot, short_motion(3))
        yield lambda robot: load_trajectory(MOTION, robot)
        yield lambda robot: link_torques(robot, q)
        yield lambda robot: forward_kinematics(robot, q)
        yield lambda robot: jacobian(robot, q)
        yield lambda robot: mass_matrix(robot, q)
        yield lambda robot: state_derivative(robot, state, self.TORQUES)
        yield lambda robot: FeedbackLinearization(robot, Gains.from_poles([-1] * 4))

    def test_a_path_for_a_robot(self) -> None:
        for function in self.functions_of_a_robot():
            message = r"robot must be a Robot, not the path 'arm.yaml'; load_robot\('arm.yaml'\) reads one"
            with pytest.raises(TypeError, match=message):
                function("arm.yaml")
            with pytest.raises(TypeError, match="robot must be a Robot, not the class Robot itself"):
                function(Robot)
            with pytest.raises(TypeError, match="robot must be a Robot, not None"):
                function(None)

    @pytest.mark.parametrize("function", [inverse_dynamics, simulate, fixes])
    def test_a_path_or_a_class_for_a_trajectory(self, function, robot, trajectory) -> None:
        call = r"load_trajectory\('motion.yaml', robot\) reads one; it comes after the robot"
        with pytest.raises(TypeError, match=f"must be a Trajectory, not the path 'motion.yaml'; {call}"):
            function(robot, "motion.yaml")
        with pytest.raises(TypeError, match="not the class Trajectory itself; load_trajectory"):
            function(robot, Trajectory)
        with pytest.raises(
            TypeError, match=r"robot must be a Robot, not a Trajectory; .* the first argument"
        ):
            function(trajectory, robot)

    def test_arguments_of_files_swapped(self, robot: Robot) -> None:
        with pytest.raises(TypeError, match=r"load_trajectory\(path, robot\)"):
            load_trajectory(robot, MOTION)
        for call in (load_robot, open_result):
            with pytest.raises(TypeError, match=rf"path must be a path, not a Robot; call {call.__name__}"):
                call(robot)

    def test_arrays_for_records(self, robot: Robot) -> None:
        q = np.zeros(3)
        with pytest.raises(
            TypeError, match=r"wrench must be a Wrench, not a list; make one by Wrench.constant"
        ):
            link_torques(robot, q, wrench=[0, 0, 1, 0, 0, 0])
        with pytest.raises(
            TypeError, match=r"state must be a State, not a numpy.ndarray; make one by State\("
        ):
            state_derivative(robot, q, self.TORQUES)
        with pytest.raises(TypeError, match=r"state must be a State, not a list; make one by State\("):
            feedback_linearization(robot, [q, q], short_motion(3).at(0.0), Gains.from_poles([-20] * 4))
        state = State(q, q, self.TORQUES, self.TORQUES)
        with pytest.raises(TypeError, match=r"gains must be a Gains, not a list; Gains.from_poles"):
            feedback_linearization(robot, state, short_motion(3).at(0.0), [-20] * 4)
        with pytest.raises(TypeError, match=r"reference must be a Motion, not a Trajectory; trajectory.at\("):
            feedback_linearization(robot, state, short_motion(3), Gains.from_poles([-20] * 4))

    def test_lists_of_another_shape(self, robot: Robot) -> None:
        for function in (link_torques, forward_kinematics, jacobian, mass_matrix):
            with pytest.raises(
                InputError, match=r"q must have the shape \(3\) or \(samples, 3\), not \(2,\)"
            ):
                function(robot, [0, 0])
            with pytest.raises(InputError, match="q must be an array"):
                function(robot, [[0, 0, 0], [0, 0]])


def test_a_single_state_is_a_row_of_many() -> None:
    robot, trajectory = vsa_3r(), short_motion(3)
    gains = Gains.from_poles([-20] * 4, [-20] * 2)
    whole = inverse_dynamics(robot, trajectory)
    rows = slice(0, SAMPLES)
    many = State(whole.q[rows], whole.dq[rows], whole.theta[rows], whole.dtheta[rows])
    one = State(*(part[3] for part in (many.q, many.dq, many.theta, many.dtheta)))
    torques = feedback_linearization(robot, many, trajectory.at(whole.time[rows]), gains)
    torque = feedback_linearization(robot, one, trajectory.at(whole.time[3]), gains)
    np.testing.assert_array_equal(torque, torques[3])
    for found, expected in zip(
        state_derivative(robot, one, torque), state_derivative(robot, many, torques), strict=True
    ):
        np.testing.assert_array_equal(found, expected[3])
    np.testing.assert_array_equal(mass_matrix(robot, one.q), mass_matrix(robot, many.q)[3])


def test_a_robot_comes_from_a_urdf() -> None:
    conversion = import_urdf(REPOSITORY / "robots" / "desk_arm.urdf", tip="flange")
    assert conversion.robot.joint_names == ("turn", "shoulder", "elbow", "quill")
