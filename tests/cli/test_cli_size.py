"""`vsacli size`: exit codes, what is said where, what is written."""

import json
import re

import pytest
from samples.catalogs import GENERIC
from samples.command_line import REPOSITORY, ROBOT, edited

ARM = REPOSITORY / "robots" / "hardening_1r.yaml"
SWING = REPOSITORY / "trajectories" / "hardening_1r.yaml"


@pytest.fixture
def motors(tmp_path):
    path = tmp_path / "motors.csv"
    path.write_text(GENERIC)
    return path


def test_a_motor_is_chosen_drawn_and_put_into_the_robot_file(vsacli, motors):
    done = vsacli("size", ARM, SWING, "--catalog", motors, "--gear", "60..160", "-o", "s.yaml", "--plot", "f")
    assert done.code == 0, done.err
    assert "motors.csv (6 motors) has a choice for the motor, utilization up to " in done.out.splitlines()[0]
    assert done.err == "wrote s.yaml\nwrote f/hardening_1r-hardening_1r-torque-speed.png\n"
    assert vsacli("validate", "s.yaml").code == 0
    assert vsacli("invdyn", "s.yaml", SWING, "-o", "r.h5").code == 0


def test_a_list_of_gears_and_several_motions_as_json(vsacli, motors, motion):
    soft = REPOSITORY / "trajectories" / "rest_to_rest_soft.yaml"
    done = vsacli(
        "size", ROBOT, motion, soft, "--catalog", motors, "--gear", "50,80", "--gear", "base=120", "--json"
    )
    assert done.code == 0, done.err
    report = json.loads(done.out)
    assert report["format"] == "vsacli-sizing/2"
    assert [each["trajectory"] for each in report["trajectories"]] == ["rest-to-rest", "rest-to-rest-soft"]
    assert {each["choices"][0]["ratio"] for each in report["motors"][:2]} == {120}
    assert {each["choices"][0]["ratio"] for each in report["motors"][2:]} <= {50, 80}
    assert report["motors"][0]["asked"]["load"]["trajectory"] == "rest-to-rest"


def test_nothing_that_does_is_told_with_what_is_nearest(vsacli, motors, tmp_path):
    weak = edited(
        motors, tmp_path / "weak.csv", ("\nflat-90", "\n# "), ("\nframe", "\n# "), ("\nflat-60", "\n# ")
    )
    weak.write_text(weak.read_text().replace("frame-85", "# ", 1))
    done = vsacli("size", ARM, SWING, "--catalog", weak, "--gear", "5", "-o", "s.yaml")
    assert done.code == 3
    assert re.search(r": no motor of \S*weak\.csv \(\d motors?\) suffices$", done.out.splitlines()[0])
    assert "no motor suffices; flat-45 with the gear 5 would use" in done.out
    assert "s.yaml is not written: there is no motor for elbow 1" in done.err
    assert not (tmp_path / "s.yaml").exists()


def test_steps_that_cannot_be_done_are_left_out_and_told(vsacli, too_soft):
    done = vsacli("size", ROBOT, too_soft)
    assert done.code == 3
    assert (
        "of 401 samples were left out as infeasible or singular, so the result does not hold for the whole"
        in done.out
    )


def test_where_no_step_can_be_done_nothing_is_drawn_and_nothing_is_made_up(vsacli, motors, tmp_path):
    source = REPOSITORY / "trajectories" / "rest_to_rest_soft.yaml"
    soft = edited(source, tmp_path / "soft.yaml", ("value: 850", "value: 700"), ("rate: 1000", "rate: 50"))
    done = vsacli("size", ROBOT, soft, "--catalog", motors, "--plot", "figures", "-o", "s.yaml")
    assert done.code == 3
    assert "base 1: no sample is feasible, so nothing is known of it" in done.out
    assert "nothing is drawn: no sample is feasible" in done.err
    assert not (tmp_path / "figures").exists()
    assert not (tmp_path / "s.yaml").exists()


@pytest.mark.parametrize("written", [[], ["-o", "s.yaml"]])
def test_rotors_that_cannot_be_coupled_so_much_are_refused_written_or_not(vsacli, tmp_path, written):
    arm, swing = (REPOSITORY / name / "awas_1r.yaml" for name in ("robots", "trajectories"))
    (tmp_path / "m.csv").write_text("name,inertia,max_torque\nm,1e-7,10\n")
    done = vsacli("size", arm, swing, "--catalog", "m.csv", "--gear", "10", *written)
    assert (done.code, done.out) == (2, "")
    assert "coupled_inertia is 0.001 on the joint's side, that of rotors of the catalog" in done.err
    assert "must be below 1e-05" in done.err
    assert not (tmp_path / "s.yaml").exists()


def test_a_criterion_names_the_motors_that_lack_it(vsacli, tmp_path):
    header = "name,inertia,max_torque,mass"
    (tmp_path / "m.csv").write_text(f"{header}\na,1e-4,1,\nb,1e-4,1,0.2\nc,1e-4,1,\n")
    done = vsacli("size", ARM, SWING, "--catalog", "m.csv", "--minimize", "mass")
    assert done.code == 2
    assert "minimizing mass needs the column mass in m.csv, which 2 motors lack (a, c)" in done.err


def test_a_trajectory_given_twice_is_questioned(vsacli):
    warning = f"warning: {SWING} is given twice; give each trajectory once"
    assert warning in vsacli("size", ARM, SWING, SWING).out.splitlines()
    assert "twice" not in vsacli("size", ARM, SWING).out


def test_limits_of_the_robots_own_motors(vsacli, tmp_path):
    arm = REPOSITORY / "robots" / "planar_2r.yaml"
    swing = REPOSITORY / "trajectories" / "planar_2r.yaml"
    assert vsacli("size", arm, swing).code == 0
    weak = edited(arm, tmp_path / "weak.yaml", ("gear_ratio: 100", "gear_ratio: 100, max_torque: 5"))
    done = vsacli("size", weak, swing)
    assert done.code == 3
    assert ": it uses " in done.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--gear", "50"], "--gear needs --catalog FILE, the motors to choose from"),
        (["--minimize", "mass"], "--minimize needs --catalog FILE, the motors to choose from"),
        (["-o", "s.yaml"], "--output needs --catalog FILE"),
        (["--catalog", "motors.csv", "--gear", "50,x"], "expected ratios such as 50,80,100 or a range"),
        (["--catalog", "motors.csv", "--gear", "50:1"], "found '50:1'; write 50\n"),
        (["--catalog", "motors.csv", "--gear", "160..50"], "'160..50' runs downward; write 50..160\n"),
        (["--catalog", "motors.csv", "--gear", "5,0"], "gear ratios must be positive and finite, not 0\n"),
        (["--catalog", "motors.csv", "--gear", "hip=5"], "there is no joint 'hip'; valid: elbow"),
        (
            ["--catalog", "motors.csv", "--gear", "5", "--gear", "6"],
            "the gears of all joints were given already",
        ),
        (["--catalog", "absent.csv"], "absent.csv: no such file"),
        (["--catalog", str(ARM)], "is a robot, but"),
    ],
)
@pytest.mark.usefixtures("motors")
def test_what_is_refused(vsacli, arguments, message):
    done = vsacli("size", ARM, SWING, *arguments)
    assert done.code == 2
    assert message in done.err


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            "m,1e-4,,,,,,,",
            "motor 'm' has no torque limit; give continuous_torque, max_torque,",
        ),
        ("m,-1e-4,1,,,,,,", "inertia: must be positive, not -0.0001 kg m^2"),
        ("m,heavy,1,,,,,,", "inertia: expected a number in kg m^2, found 'heavy'"),
        ("m,1e-4,1,,,,0.5,,", "resistance: needs torque_constant, too"),
        ("m,1e-4,1,,,0.1,,,24", "max_voltage: needs resistance, too"),
        ("m,1e-4,1,2,,,,,,", "expected 9 values"),
    ],
)
def test_what_is_wrong_with_a_motor(vsacli, tmp_path, row, message):
    header = "name,inertia,continuous_torque,max_torque,max_velocity,torque_constant"
    header += ",resistance,max_current,max_voltage"
    (tmp_path / "m.csv").write_text(f"{header}\n{row}\n")
    done = vsacli("size", ARM, SWING, "--catalog", "m.csv")
    assert done.code == 2
    assert done.err.startswith("m.csv:2: ")
    assert message in done.err


def test_a_file_that_exists_is_refused_before_anything_is_computed(vsacli, motors, tmp_path):
    (tmp_path / "s.yaml").write_text("mine")
    done = vsacli("size", ARM, SWING, "--catalog", motors, "-o", "s.yaml")
    assert done.code == 4
    assert (tmp_path / "s.yaml").read_text() == "mine"
