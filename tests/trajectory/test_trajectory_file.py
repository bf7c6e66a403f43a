"""Trajectory files: closed forms, CSV samples and mixtures of them, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from vsacli import InputError, load_robot, load_trajectory

pytestmark = pytest.mark.usefixtures("own_folder")

ROOT = Path(__file__).parents[2]

TEXT = """\
format: vsacli-trajectory/1
name: reach
duration: 2.0
rate: 100
position:
  type: polynomial
  degree: 7
  start: 0
  end: {slide: 0.2, arm: 60 deg}
stiffness:
  type: polynomial
  degree: 3
  start: [900, 9000]
  end: 9500
"""
POSITION = TEXT[TEXT.index("position:") : TEXT.index("stiffness:")]
STIFFNESS = TEXT[TEXT.index("stiffness:") :]
HEAD = "format: vsacli-trajectory/1\nname: reach\n"
RECORDED_POSITION = "position: {type: csv, file: motion.csv}\n"
RECORDED_STIFFNESS = "stiffness: {type: csv, file: motion.csv}\n"


@pytest.fixture(scope="module")
def robot():
    """A revolute joint `arm` and a prismatic joint `slide`."""
    return load_robot(ROOT / "robots" / "rp_2.yaml")


@pytest.fixture
def load(robot):
    """Load a trajectory from a text, as `move.yaml`."""

    def load_text(text):
        Path("move.yaml").write_text(text)
        return load_trajectory("move.yaml", robot)

    return load_text


def write_csv(name, *quantities, times=(0.0, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)):
    """Columns of both joints whose values differ; returns them, (samples, quantities, joints)."""
    values = 1 + np.arange(len(times) * len(quantities) * 2).reshape(len(times), -1) ** 2 / 7
    header = ["time", *(f"{joint}.{quantity}" for quantity in quantities for joint in ("arm", "slide"))]
    rows = np.column_stack([times, values]).tolist()
    Path(name).write_text("\n".join([",".join(header), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return values.reshape(len(times), len(quantities), 2)


def test_polynomials(load):
    trajectory = load(TEXT)
    assert (trajectory.name, trajectory.samples, trajectory.duration) == ("reach", 201, 2.0)
    assert trajectory.warnings == ()
    whole = trajectory.block(0, 201)
    assert whole.time[[0, -1]].tolist() == [0.0, 2.0]
    assert whole.q[[0, -1]].tolist() == [[0, 0], [math.radians(60), 0.2]]
    assert whole.commanded["stiffness"][[0, -1]].tolist() == [[900, 9000], [9500, 9500]]
    for derivative in (whole.dq, whole.ddq, whole.d3q, whole.commanded["dstiffness"]):
        assert not derivative[[0, -1]].any()
    assert whole.d4q[[0, -1]].all()  # degree 7 leaves the fourth derivative free
    assert whole.commanded["ddstiffness"][[0, -1]].all()  # and degree 3 the second


def test_constants(load):
    position = "position: {type: constant, value: [90 deg, 0.1]}\n"
    block = load(HEAD + "duration: 1\n" + position + "stiffness: {type: constant, value: 9000}\n").block(
        0, 1001
    )
    assert (block.q == [math.pi / 2, 0.1]).all()
    assert (block.commanded["stiffness"] == 9000).all()
    assert not block.dq.any()


def test_the_rate_is_1000_unless_given(load):
    assert load(TEXT.replace("rate: 100\n", "")).samples == 2001


def test_a_rate_that_does_not_fit_the_duration_is_noted(load):
    trajectory = load(TEXT.replace("rate: 100\n", "rate: 100.3\n"))
    assert trajectory.samples == 202  # round(2.0 * 100.3) = 201 steps
    assert any("100.5" in note and "100.3" in note for note in trajectory.notes)


def test_at_least_one_step(load):
    assert load(TEXT.replace("rate: 100\n", "rate: 0.01\n")).samples == 2


def test_both_recorded_in_one_file(load):
    values = write_csv("motion.csv", "q", "stiffness")
    trajectory = load(HEAD + RECORDED_POSITION + RECORDED_STIFFNESS)
    block = trajectory.block(0, 8)
    assert block.time.tolist() == [0.0, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0]
    assert (block.q == values[:, 0]).all()
    assert (block.commanded["stiffness"] == values[:, 1]).all()
    assert [source.path for source in trajectory.sources] == ["move.yaml", "motion.csv"]
    assert any("dq, ddq, d3q, d4q come from a C6 spline through q" in w for w in trajectory.warnings)


def test_the_file_of_samples_is_found_beside_the_trajectory(tmp_path, monkeypatch, robot):
    folder = tmp_path / "moves"
    folder.mkdir()
    monkeypatch.chdir(folder)
    write_csv("motion.csv", "q", "stiffness")
    Path("move.yaml").write_text(HEAD + RECORDED_POSITION + RECORDED_STIFFNESS)
    monkeypatch.chdir(tmp_path)
    assert load_trajectory("moves/move.yaml", robot).samples == 8


def test_recorded_in_two_files_with_equal_times(load):
    position, stiffness = write_csv("motion.csv", "q"), write_csv("stiffness.csv", "stiffness", "q")
    trajectory = load(HEAD + RECORDED_POSITION + RECORDED_STIFFNESS.replace("motion", "stiffness"))
    assert (trajectory.block(0, 8).q == position[:, 0]).all()
    assert (trajectory.block(0, 8).commanded["stiffness"] == stiffness[:, 0]).all()
    assert [source.path for source in trajectory.sources] == ["move.yaml", "motion.csv", "stiffness.csv"]
    assert "stiffness.csv: its columns of q are not used" in trajectory.notes


def test_recorded_in_two_files_with_other_times(load):
    write_csv("motion.csv", "q")
    write_csv("stiffness.csv", "stiffness", times=[0.0, 0.5, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0])
    with pytest.raises(InputError, match=r"^stiffness.csv:4: time is 0.8 s, but 0.75 s in .* motion.csv"):
        load(HEAD + RECORDED_POSITION + RECORDED_STIFFNESS.replace("motion", "stiffness"))


def test_recorded_position_with_a_stiffness_polynomial_over_its_times(load):
    write_csv("motion.csv", "q", times=(1.0, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0))
    block = load(HEAD + RECORDED_POSITION + STIFFNESS).block(0, 8)
    assert block.commanded["stiffness"][[0, -1]].tolist() == [[900, 9000], [9500, 9500]]
    assert block.commanded["stiffness"][4].tolist() == [5200, 9250]  # 2.5 s is half-way


def test_recorded_stiffness_with_a_position_polynomial_over_its_times(load):
    write_csv("motion.csv", "stiffness", times=(1.0, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0))
    block = load(HEAD + POSITION + RECORDED_STIFFNESS).block(0, 8)
    assert block.q[[0, -1]].tolist() == [[0, 0], [math.radians(60), 0.2]]
    assert block.q[4] == pytest.approx(
        [math.radians(30), 0.1], rel=1e-15
    )  # half-way, to the last digit or two


def test_a_bare_table(robot):
    values = write_csv("motion.CSV", "q", "stiffness")
    trajectory = load_trajectory("motion.CSV", robot)
    assert trajectory.name == "motion"
    assert (trajectory.block(0, 8).q == values[:, 0]).all()
    assert (trajectory.block(0, 8).commanded["stiffness"] == values[:, 1]).all()


def test_a_bare_table_without_stiffness(robot):
    write_csv("motion.csv", "q")
    with pytest.raises(
        InputError, match=r"^motion.csv:1: the columns arm.stiffness, slide.stiffness are mis"
    ):
        load_trajectory("motion.csv", robot)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("vsacli-trajectory/1", "vsacli-robot/1", "1: format: expected 'vsacli-trajectory/1', found"),
        ("duration: 2.0\n", "", "1: missing key 'duration' (s)"),
        ("duration: 2.0", "duration: 0", "3: duration: must be positive, not 0"),
        (
            "duration: 2.0",
            "duration: 1e9",
            "3: duration: duration 1e+09 s times rate 100 Hz gives 1e+11 samples; at most 1e+09",
        ),
        ("rate: 100", "rate: -1", "4: rate: must be positive, not -1"),
        ("rate: 100", "rat: 100", "4: unknown key 'rat'; did you mean 'rate'?"),
        ("rate: 100", "wrench: {}", "4: wrench: missing key 'type', one of polynomial, steps, constant, csv"),
        (
            "type: polynomial\n  degree: 7",
            "type: via_points",
            "6: position.type: unknown word 'via_points'; valid: ",
        ),
        ("degree: 7", "degree: 7.5", "7: degree: expected a whole number, found '7.5'"),
        ("start: 0\n", "start: on\n", "8: start: expected a number in rad, found 'on'"),
        (
            "start: 0\n",
            "start: 90 deg\n",
            "8: start: '90 deg' is an angle; expected a number in m",
        ),
        (
            "{slide: 0.2, arm: 60 deg}",
            "{slide: 60 deg, arm: 0}",
            "9: end: '60 deg' is an angle; expected a number in m",
        ),
        ("{slide: 0.2, arm: 60 deg}", "{slide: 0.2}", "9: end: no value for arm; each joint needs one"),
        ("slide: 0.2", "slid: 0.2", "9: end: no joint is called 'slid'; did you mean 'slide'?"),
        (
            "[900, 9000]",
            "[900]",
            "13: start: expected 2 values, one for each joint (arm, slide), found 1; is the file for",
        ),
        (
            "[900, 9000]",
            "[900, 9000, 1]",
            "13: start: expected 2 values, one for each joint (arm, slide), found 3; is the file for",
        ),
        ("[900, 9000]", "[900, -9000]", "13: start of joint slide: must be positive, not -9000 N/m"),
        ("[900, 9000]", "{arm: 0, slide: 9000}", "13: start of joint arm: must be positive, not 0"),
    ],
)
def test_a_problem_is_named_with_its_line(load, old, new, problem):
    assert TEXT.count(old) == 1
    with pytest.raises(InputError) as caught:
        load(TEXT.replace(old, new))
    assert any(line.startswith(f"move.yaml:{problem}") for line in str(caught.value).splitlines())


@pytest.mark.parametrize("degree", [3, 5, 6, 8, 17, -7])
def test_a_position_of_this_degree_is_refused(load, degree):
    with pytest.raises(
        InputError,
        match=rf"^move.yaml:7: degree: .* up to the third must vanish at both ends.*, not {degree}$",
    ):
        load(TEXT.replace("degree: 7", f"degree: {degree}"))


@pytest.mark.parametrize("degree", [1, 2, 4, 17])
def test_a_stiffness_of_this_degree_is_refused(load, degree):
    with pytest.raises(
        InputError, match=rf"^move.yaml:12: degree: .*its rate must vanish at both ends.*, not {degree}$"
    ):
        load(TEXT.replace("degree: 3", f"degree: {degree}"))


@pytest.mark.parametrize(("position", "stiffness"), [(7, 3), (9, 5), (15, 15)])
def test_odd_degrees_are_accepted(load, position, stiffness):
    text = TEXT.replace("degree: 7", f"degree: {position}").replace("degree: 3", f"degree: {stiffness}")
    assert load(text).samples == 201


def test_duration_beside_samples_is_refused(load):
    write_csv("motion.csv", "q", "stiffness")
    with pytest.raises(InputError) as caught:
        load(HEAD + "duration: 2\nrate: 100\n" + RECORDED_POSITION + RECORDED_STIFFNESS)
    assert str(caught.value) == "move.yaml:3: duration: the times come from the CSV file; leave this key out"


def test_samples_that_are_missing(load):
    write_csv("motion.csv", "q", "stiffness")
    with pytest.raises(InputError, match=r"^moton.csv: no such file; did you mean 'motion.csv'\?"):
        load(HEAD + RECORDED_POSITION.replace("motion", "moton") + STIFFNESS)


@pytest.mark.parametrize(
    ("robot_name", "trajectory_name", "samples"),
    [
        ("vsa_3r", "rest_to_rest", 4001),
        ("vsa_3r", "rest_to_rest_soft", 4001),
        ("vsa_3r", "rest_to_rest_stiff", 4001),
        ("lwr_7r_vsa", "lwr_7r", 3001),
        ("rp_2", "rp_2", 2001),
    ],
)
def test_the_shipped_trajectories_fit_their_robots(robot_name, trajectory_name, samples):
    robot = load_robot(ROOT / "robots" / f"{robot_name}.yaml")
    trajectory = load_trajectory(ROOT / "trajectories" / f"{trajectory_name}.yaml", robot)
    assert (trajectory.samples, trajectory.warnings, trajectory.notes) == (samples, (), ())


def test_the_motion_of_the_paper_as_we_choose_it():
    robot = load_robot(ROOT / "robots" / "vsa_3r.yaml")
    ends = {}
    for name in ("rest_to_rest", "rest_to_rest_soft", "rest_to_rest_stiff"):
        trajectory = load_trajectory(ROOT / "trajectories" / f"{name}.yaml", robot)
        last = trajectory.block(4000, 4001)
        assert last.time.tolist() == [4.0]
        assert last.q.tolist() == [[math.radians(90), math.radians(45), math.radians(-60)]]
        ends[name] = (trajectory.block(0, 1).commanded["stiffness"][0, 0], last.commanded["stiffness"][0, 0])
    assert ends == {
        "rest_to_rest": (850, 1275),
        "rest_to_rest_soft": (850, 850),
        "rest_to_rest_stiff": (1275, 1275),
    }
