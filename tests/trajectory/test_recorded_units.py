"""Units, separators and resampling of recorded motions, from the file to the trajectory."""

from pathlib import Path

import numpy as np
import pytest

from vsacli import InputError, Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.base.signals import POSITION
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.trajectory.fits import FitChoice
from vsacli.trajectory.recorded.recording import read_recorded_signals, recorded_trajectory

pytestmark = pytest.mark.usefixtures("own_folder")

ROOT = Path(__file__).parents[2]
JOINTS = CommandedJoints({"arm": "revolute", "slide": "prismatic"}, exempt={})
TIME = np.arange(2001) / 1000
RATES = np.array([3.0, 2.0])


def motion(order=0, time=TIME):
    """Of both joints, (samples, 2), rad and m per s^order."""
    return 0.2 * RATES**order * np.sin(RATES * time[:, None] + order * np.pi / 2)


def stiffness(order=0, time=TIME):
    """Of both joints, N m/rad and N/m per s^order."""
    level = np.array([1000.0, 9000.0]) * (order == 0)
    return level + 50 * np.sin(time[:, None] + order * np.pi / 2)


def write(path, header, *columns, separator=","):
    rows = np.column_stack(columns).tolist()
    lines = [separator.join(header), *(separator.join(map(repr, row)) for row in rows)]
    Path(path).write_text("\n".join(lines) + "\n")
    return Path(path)


@pytest.fixture
def robot():
    """A revolute joint `arm` and a prismatic joint `slide`."""
    return load_robot(ROOT / "robots" / "rp_2.yaml")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_units_in_brackets_are_converted(separator):
    header = [
        "time [ms]",
        "q1[deg]",
        "q2[mm]",
        "dq1[deg/s]",
        "dq2[mm/s]",
        "stiffness1[N m/deg]",
        "stiffness2[N/mm]",
    ]
    degrees, per_degree = np.array([180 / np.pi, 1e3]), np.array([np.pi / 180, 1e-3])
    columns = (1e3 * TIME, degrees * motion(), degrees * motion(1), per_degree * stiffness())
    found = recorded_trajectory(write("m.csv", header, *columns, separator=separator), JOINTS).block(0, 2001)
    np.testing.assert_array_equal(found.time, TIME)  # 3 ms are 0.003 s, to the last bit
    np.testing.assert_allclose(found.q, motion(), rtol=1e-15)
    np.testing.assert_allclose(found.dq, motion(1), rtol=1e-15)
    np.testing.assert_allclose(found.commanded["stiffness"], stiffness(), rtol=1e-15)


def test_units_of_a_wrench_are_forces_then_moments(robot):
    axes = ["fx[kN]", "fy[N]", "fz[mN]", "mx[N m]", "my[Nmm]", "mz"]
    write("push.csv", ["time", *axes], TIME, *(np.sin(TIME + i) for i in range(6)))
    text = (ROOT / "trajectories" / "rp_2.yaml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("duration")]
    Path("m.yaml").write_text("\n".join([*lines, "wrench: {type: csv, frame: base, file: push.csv}"]))
    found = load_trajectory("m.yaml", robot).block(0, 2001).wrench.wrench
    expected = np.stack([np.sin(TIME + i) for i in range(6)], axis=1) * [1e3, 1, 1e-3, 1, 1e-3, 1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)  # of 1 kN, by a few operations


def test_units_in_parentheses_are_told_to_stand_in_brackets():
    header = ["time (ms)", "arm.q (deg)", "slide.q", "arm.stiffness", "slide.stiffness"]
    write("m.csv", header, 1e3 * TIME, motion(), stiffness())
    with pytest.raises(InputError) as caught:
        recorded_trajectory("m.csv", JOINTS)
    assert [str(problem) for problem in caught.value.problems][:2] == [
        "m.csv:1: 'time (ms)': units are written in square brackets, time [ms]",
        "m.csv:1: 'arm.q (deg)': units are written in square brackets, arm.q [deg]",
    ]


def test_all_units_that_do_not_fit_are_named_with_the_line():
    header = ["time[h]", "arm.q[m]", "slide.q[m]", "arm.stiffness[N/m]", "slide.stiffness[]"]
    write("m.csv", header, TIME, motion(), stiffness())
    with pytest.raises(InputError) as caught:
        recorded_trajectory("m.csv", JOINTS)
    found = [str(problem) for problem in caught.value.problems]
    assert found == [
        "m.csv:1: column 'time': unknown unit [h]; expected a time in s, ms, us, ns or min",
        "m.csv:1: column 'arm.q': [m] is a length, expected an angle in rad, deg or rev",
        "m.csv:1: column 'arm.stiffness': [N/m] is a linear stiffness, expected a rotational stiffness in "
        "N m/rad",
        "m.csv:1: column 'slide.stiffness': unknown unit []; expected a linear stiffness in N/m",
    ]


def test_columns_with_the_same_wrong_unit_share_a_message():
    header = ["time", "arm.q[V]", "slide.q", "arm.stiffness[V]", "slide.stiffness[A]"]
    write("m.csv", header, TIME, motion(), stiffness())
    with pytest.raises(InputError) as caught:
        recorded_trajectory("m.csv", JOINTS)
    assert [str(problem) for problem in caught.value.problems] == [
        "m.csv:1: column 'arm.q': [V] is a voltage, expected an angle in rad, deg or rev",
        "m.csv:1: column 'arm.stiffness': [V] is a voltage, expected a rotational stiffness in N m/rad",
        "m.csv:1: column 'slide.stiffness': [A] is a current, expected a linear stiffness in N/m",
    ]


def test_a_column_with_two_units_appears_twice():
    write("m.csv", ["time", "q1[rad]", "q1[deg]", "q2"], TIME, motion(), motion()[:, :1])
    with pytest.raises(InputError, match=r"m.csv:1: column 'q1' appears 2 times"):
        read_recorded_signals("m.csv", JOINTS, {POSITION: FitChoice()})


def test_lines_are_those_of_the_file_with_comments():
    write("m.csv", ["time", "q1", "q2"], TIME, motion())
    lines = Path("m.csv").read_text().splitlines()
    lines[10] = lines[9]
    Path("m.csv").write_text("\n".join(["# made by hand", *lines[:5], "# a pause", *lines[5:]]))
    with pytest.raises(InputError, match=r"^m.csv:13: time must increase, but 0.008 s appears twice"):
        read_recorded_signals("m.csv", JOINTS, {POSITION: FitChoice()})


@pytest.mark.parametrize("derivatives", [False, True])
def test_round_trip_of_an_analytic_motion(derivatives):
    """Full digits at 1 kHz: what is given comes back to the bit, the rest to what rounding allows."""
    orders = range(5 if derivatives else 1), range(3 if derivatives else 1)
    names = [f"{name}{i}" for name in POSITION.names[: len(orders[0])] for i in (1, 2)]
    names += [f"{'d' * order}stiffness{i}" for order in orders[1] for i in (1, 2)]
    columns = [*map(motion, orders[0]), *map(stiffness, orders[1])]
    trajectory = recorded_trajectory(write("m.csv", ["time", *names], TIME, *columns), JOINTS)
    found, inside = trajectory.block(0, 2001), slice(10, -10)
    np.testing.assert_array_equal(found.q, motion())
    np.testing.assert_array_equal(found.commanded["stiffness"], stiffness())
    for order, name in enumerate(POSITION.names):
        # eps |q| times the gain of interpolation, some five standard deviations
        atol = 0.0 if derivatives else 5 * 37 * 3e-17 * 1000**order
        np.testing.assert_allclose(found.of_joints[name][inside], motion(order)[inside], rtol=0, atol=atol)
    assert trajectory.warnings == () if derivatives else len(trajectory.warnings) == 2


@pytest.mark.slow
def test_noisy_record_runs_and_reports_its_fit(robot):
    noisy = motion() + 1e-5 * np.random.default_rng(0).standard_normal((2001, 2))
    names = ["q1", "q2", "stiffness1", "stiffness2"]
    path = write("m.csv", ["time", *names], TIME, noisy, stiffness())
    trajectory = load_trajectory(path, robot)
    result = inverse_dynamics(robot, trajectory)
    assert result.report.self_check.passed
    assert np.abs(result.q - motion()).max() < 5e-6 < np.abs(noisy - motion()).max()
    position, rigidity = result.report.as_json()["fits"]
    assert (position["signal"], position["degree"], rigidity["signal"]) == ("q", 7, "stiffness")
    for column, joint in zip(position["columns"], ("arm", "slide"), strict=True):
        assert (column["name"], column["method"]) == (joint, "smooth")
        assert column["residual"]["rms"] == pytest.approx(1e-5, rel=0.1)
    assert {column["method"] for column in rigidity["columns"]} == {"interpolate"}
    assert (
        "q, dq, ddq, d3q, d4q come from a C6 smoothing spline near the samples of q: "
        in result.report.warnings[0]
    )


@pytest.mark.slow
def test_fast_and_rounded_records_have_a_meaningful_fourth_derivative():
    time = np.arange(20001) / 10000
    trajectory = Trajectory.from_samples(time, np.round(motion(0, time), 6))
    inside = slice(5000, -5000)
    found = trajectory.block(0, 20001).d4q[inside]
    assert np.abs(found - motion(4, time)[inside]).max() < 0.02 * 0.2 * 81
    plain = Trajectory.from_samples(time, np.round(motion(0, time), 6), fit="interpolate")
    assert np.abs(plain.block(0, 20001).d4q[inside]).max() > 1e6


@pytest.mark.slow
@pytest.mark.parametrize("rate", [250, 4000, 333.3])
def test_rate_resamples_the_fit(robot, rate):
    names = [f"{name}{i}" for name in POSITION.names for i in (1, 2)] + ["stiffness1", "stiffness2"]
    columns = [motion(order) for order in range(5)] + [stiffness()]
    write("m.csv", ["time[ms]", *names], 1e3 * (3 + TIME), *columns)
    course = "{type: csv, file: m.csv}"
    text = f"format: vsacli-trajectory/1\nname: m\nrate: {rate}\nposition: {course}\nstiffness: {course}\n"
    Path("m.yaml").write_text(text)
    trajectory = load_trajectory("m.yaml", robot)
    steps = round(2 * rate)
    assert trajectory.samples == steps + 1
    found = trajectory.block(0, trajectory.samples)
    np.testing.assert_allclose(found.time, 3 + 2 * np.arange(steps + 1) / steps, rtol=1e-15)
    assert found.time[-1] == 5.0
    np.testing.assert_allclose(found.q, motion(0, found.time - 3), atol=1e-13)
    inside = (found.time > 3.01) & (found.time < 4.99)
    np.testing.assert_allclose(found.dq[inside], motion(1, found.time - 3)[inside], atol=1e-11)
    assert "the given dq, ddq, d3q, d4q play no part, since the steps are resampled" in trajectory.notes
    assert any("333.5 Hz, not 333.3 Hz" in w for w in trajectory.notes) == (rate == 333.3)
    assert inverse_dynamics(robot, trajectory).report.self_check.passed


def test_rate_that_is_not_possible(robot):
    write("m.csv", ["time", "q1", "q2"], TIME, motion())
    head = "format: vsacli-trajectory/1\nname: m\nrate: 1e12\n"
    Path("m.yaml").write_text(
        head + "position: {type: csv, file: m.csv}\nstiffness: {type: constant, value: 900}\n"
    )
    with pytest.raises(
        InputError, match=r"^m.yaml: rate: .* times rate 1e\+12 Hz gives 2e\+12 samples; at most"
    ):
        load_trajectory("m.yaml", robot)


@pytest.mark.slow
def test_fit_that_is_asked_for():
    write("m.csv", ["time", "q1", "q2"], TIME, motion())
    for method, exact in (("lsq", False), ("interpolate", True), (None, True)):
        (profile,) = read_recorded_signals("m.csv", JOINTS, {POSITION: FitChoice(method)}).profiles
        assert profile.fit.exact.all() == exact
    with pytest.raises(InputError, match="fit must be one of lsq, interpolate, smooth, not 'spline'"):
        Trajectory.from_samples(TIME, motion(), fit="spline")


@pytest.mark.slow
def test_fit_in_the_file(robot):
    write("m.csv", ["time", "q1", "q2", "stiffness1", "stiffness2"], TIME, motion(), stiffness())
    courses = "position: {type: csv, file: m.csv, fit: lsq}\nstiffness: {type: csv, file: m.csv, fit: FIT}\n"
    text = "format: vsacli-trajectory/1\nname: m\n" + courses
    Path("m.yaml").write_text(text.replace("FIT", "interpolate"))
    trajectory = load_trajectory("m.yaml", robot)
    assert not trajectory.position.fit.exact.any()
    assert trajectory.commanded["stiffness"].fit.exact.all()
    Path("m.yaml").write_text(text.replace("FIT", "spline"))
    with pytest.raises(InputError, match=r"^m.yaml:4: fit: unknown word 'spline'; valid: lsq, interpolate"):
        load_trajectory("m.yaml", robot)


@pytest.mark.slow
def test_what_is_known_of_noise_in_the_file(robot):
    rng = np.random.default_rng(0)
    time = np.arange(2001) / 200
    q = np.column_stack([np.sin(time), np.cos(2 * time)]) + 1e-4 * rng.standard_normal((2001, 2))
    write("m.csv", ["time", "q1", "q2"], time, q)
    text = "format: vsacli-trajectory/1\nname: m\nposition: {type: csv, file: m.csv, KEYS}\n"
    text += "stiffness: {type: constant, value: 900}\n"

    def load(keys):
        Path("m.yaml").write_text(text.replace("KEYS", keys))
        return load_trajectory("m.yaml", robot)

    (summary,) = load("noise: [1e-4, 2e-4], bandwidth: 2").fits
    assert [column["noise"] for column in summary["columns"]] == [1e-4, 2e-4]
    assert {column["method"] for column in summary["columns"]} == {"smooth"}
    # four knot spans to a period of 2 Hz, in 10 s
    assert {column["knots"] for column in summary["columns"]} == {81}
    assert load("noise: 1e-4").fits[0]["columns"][1]["noise"] == 1e-4
    for keys, said in (
        ("noise: [1e-4, -1]", r"^m.yaml:3: noise of \S+: must be positive|noise"),
        ("noise: 0", "must be positive"),
        ("bandwidth: -2", r"^m.yaml:3: bandwidth: must be positive"),
        (
            "bandwidth: 2, fit: lsq",
            "m.yaml:3: position: bandwidth: only smoothing splines have one",
        ),
    ):
        with pytest.raises(InputError, match=said):
            load(keys)
