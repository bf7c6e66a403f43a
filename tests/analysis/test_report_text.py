"""The report as text: what it says, in how many digits, for how many steps."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

from vsacli.analysis.derivative_check import SelfCheck
from vsacli.analysis.joint_report import COUNTED, JointReport, Worst
from vsacli.analysis.report import Report
from vsacli.analysis.trouble_text import sentences
from vsacli.dynamics.energy import JointEnergy

NAN = math.nan

QUIET = JointReport(
    name="elbow",
    type="revolute",
    actuator="antagonistic",
    steps=dict.fromkeys(COUNTED, 0),
    first_time={},
    worst={},
    margin=0.0576,
    margin_time=0.1,
    reachable=(801.0983, math.inf),
    commanded_min=850.0,
    commanded_max=1275.0,
    peak_tau_e=7.55,
    peak_tau_motor=(98.871, 91.635),
    start_theta=(0.0727618, -0.0551276),
    torque_step=(0.35, 0.42),
    other_preload=False,
    energy=JointEnergy(9.66, 20.4, 11.2, 61.2, 2.84),
    start_dtheta=(0.0, 0.0),
    end_theta=(-0.8426, -1.2396),
    end_dtheta=(0.0, 0.0),
    peak_dtheta=(0.9, 0.6),
)


def render(found: Report) -> str:
    """The text of a report, and of what a file would make of it."""
    text = str(found)
    again = Report.from_json(json.loads(json.dumps(found.as_json(), allow_nan=False)))
    assert str(again) == text
    return text


def report(*joints: JointReport, **changes: object) -> Report:
    whole = Report(
        robot="vsa-3r",
        trajectory="rest-to-rest",
        samples=4001,
        duration=4.0,
        complete=True,
        self_check=SelfCheck(spring_residual=4e-15, ladder=4.2e-11),
        joints=joints or (QUIET,),
    )
    return replace(whole, **changes)


def troubled(worst: Worst, steps: int = 412, first: float = 3.588, **changes: object) -> JointReport:
    """The elbow with one kind of trouble."""
    counted = worst.kind if worst.kind in COUNTED else "over_limit"
    return replace(
        QUIET,
        steps={**QUIET.steps, counted: steps},
        first_time={worst.kind: first, counted: first},
        worst={worst.kind: worst},
        **changes,
    )


def too_soft(value: float, bound: float, **changes: object) -> JointReport:
    return troubled(Worst("infeasible", 4.0, value, bound, "N m/rad"), **changes)


def sentence(joint: JointReport) -> str:
    (only,) = sentences([joint])
    return only


def line(text: str, start: str) -> str:
    (only,) = [each for each in text.splitlines() if each.startswith(start)]
    return only


def test_whole_report_of_a_run_without_trouble():
    slide = replace(
        QUIET,
        name="slide",
        type="prismatic",
        reachable=(8009.5, 20000.0),
        commanded_min=9000.0,
        commanded_max=9000.0,
        start_theta=(0.0317, 0.00602),
        end_theta=(0.2317, 0.18602),
        torque_step=(0.1, 0.2),
        margin=0.11,
        energy=JointEnergy(12.04, 20.4, 11.2, 31.0, 5.0),
    )
    assert render(report(QUIET, slide)).splitlines() == [
        "vsa-3r, rest-to-rest: 4001 steps, 4 s                                       OK",
        "joint   peak tau_e   peak motor 1 / 2   stiffness        reachable    margin",
        "elbow     7.55 N m    98.9 / 91.6 N m    850-1275       from 801.1    5.76 %",
        "slide       7.55 N      98.9 / 91.6 N        9000   8009.5-20000.0   11.00 %",
        "start motors at: elbow +0.07276 -0.05513 rad, slide +0.0317 +0.00602 m",
        "torque step at start: 0.42 N m (elbow)",
        "end motors at: elbow -0.8426 -1.24 rad, slide +0.2317 +0.186 m",
        "energy: motors spend 40.8 J, take back 22.4 J; springs hold up to 12.0 J (slide)",
        "co-contraction: up to 61.2 N m rms for each motor (elbow), its load takes 2.84 N m",
        "self-check passed (4e-11, bound 1e-08)",
    ]


@pytest.mark.parametrize(
    ("energy", "expected"),
    [
        (JointEnergy(9.66, NAN, NAN, NAN, NAN), []),
        (
            JointEnergy(0.5, 3.0, 1.0, NAN, NAN),
            ["energy: motors spend 3 J, take back 1 J; springs hold up to 0.5 J (elbow)"],
        ),
        (JointEnergy(0.0, 3.0, 1.0, NAN, NAN), ["energy: motors spend 3 J, take back 1 J"]),
    ],
    ids=["a step without torques", "one motor", "no springs"],
)
def test_energy_that_does_not_exist_is_not_mentioned(energy, expected):
    lines = render(report(replace(QUIET, energy=energy))).splitlines()
    assert [line for line in lines if line.startswith(("energy", "co-contraction"))] == expected


def test_energies_are_summed_only_if_every_joint_has_them():
    lines = render(report(replace(QUIET, energy=JointEnergy(NAN, NAN, NAN, NAN, NAN)), QUIET)).splitlines()
    assert not [line for line in lines if line.startswith("energy")]
    [line] = [line for line in lines if line.startswith("co-contraction")]
    assert "61.2 N m" in line


def test_headline_counts_the_joints_concerned():
    text = render(report(too_soft(790, 803.1), QUIET, QUIET))
    assert text.splitlines()[0].endswith("INFEASIBLE (1 of 3 joints)")
    assert len(text.splitlines()[0]) == 78


@pytest.mark.parametrize(
    ("worst", "verdict"),
    [
        (Worst("singular", 1.0, 800.0, 800.0, "N m/rad"), "SINGULAR (1 of 1 joints)"),
        (Worst("velocity_limit", 1.0, 4.0, 3.0, "rad/s"), "OVER LIMIT (1 of 1 joints)"),
        (Worst("near_singular", 1.0, 801.0, 800.0, "N m/rad"), "OK"),
    ],
    ids=lambda value: value.kind if isinstance(value, Worst) else "",
)
def test_headline_says_the_verdict(worst, verdict):
    headline = render(report(troubled(worst))).splitlines()[0]
    assert headline.split("  ")[-1].strip() == verdict


def test_run_that_ended_early_says_so():
    headline = render(report(samples=1, complete=False)).splitlines()[0]
    assert headline.startswith("vsa-3r, rest-to-rest: 1 step, 4 s planned, stopped early ")


def test_infeasible_stiffness_names_time_bound_and_remedy():
    assert sentence(too_soft(790, 803.1)) == (
        "elbow: stiffness 790 N m/rad at t = 4.000 s is below the 803.1 its load allows, raise it "
        "(412 steps, from 3.588 s)"
    )
    assert "is above the 1500 its load allows, lower it" in sentence(too_soft(1600, 1500))


def test_one_step_is_singular_in_both_senses():
    assert sentence(too_soft(790, 803.1, steps=1)).endswith("raise it (1 step)")


@pytest.mark.parametrize(
    ("value", "bound", "shown"),
    [
        (816.541821, 816.547384, ("816.5418", "816.5474")),
        (790.0, 790.0000012, ("790", "790.0000012")),
        (12000.0, 11999.5, ("12000", "11999.5")),
        (7535.4, 12536.9, ("7535", "12537")),
        (800.0, 800.0, ("800", "800")),
    ],
)
def test_value_and_bound_are_shown_with_enough_digits_to_differ(value, bound, shown):
    text = sentence(too_soft(value, bound))
    assert re.search(r"stiffness (\S+) N m/rad", text)[1] == shown[0]
    assert re.search(r"the (\S+) its load allows", text)[1] == shown[1]


def test_torque_that_cannot_be_carried_has_no_bound():
    text = sentence(too_soft(790, NAN, margin=NAN, reachable=(NAN, NAN)))
    assert "its springs cannot carry the elastic torque at t = 4.000 s at any stiffness (412 steps" in text
    row = line(render(report(too_soft(790, NAN, margin=NAN, reachable=(NAN, NAN)))), "elbow ")
    assert row.split()[-2:] == ["nothing", "none"]


def test_what_else_would_help_is_said():
    assert sentence(too_soft(790, 803.1, other_preload=True)).endswith(
        "; the opposite preload would reach it"
    )
    slack = too_soft(790, 803.1)
    slack = replace(slack, steps={**slack.steps, "slack": 7})
    assert sentence(slack).endswith("; a tendon goes slack at 7 steps")


def test_singular_step_says_what_is_undefined():
    text = sentence(troubled(Worst("singular", 1.25, 800.0, 800.0, "N m/rad"), steps=1))
    assert text == (
        "elbow: stiffness 800 N m/rad at t = 1.250 s is singular: "
        "motor torques are undefined at the end of its range, raise it (1 step)"
    )


def test_near_singular_step_is_a_warning():
    text = sentence(troubled(Worst("near_singular", 1.25, 800.5, 800.1, "N m/rad")))
    assert text == (
        "elbow: warning: stiffness 800.5 N m/rad at t = 1.250 s is 0.05 % from singular, "
        "where motor torques grow without bound (412 steps, from 3.588 s)"
    )


@pytest.mark.parametrize(
    ("worst", "said"),
    [
        (Worst("position_limit", 2.0, 1.7, 1.6, "rad"), "position is 1.7 rad at t = 2.000 s, above its"),
        (Worst("velocity_limit", 2.0, -4.0, -3.0, "m/s"), "velocity is -4 m/s at t = 2.000 s, below its"),
        (Worst("stiffness_limit", 2.0, 9.0, 8.0, "N/m"), "stiffness is 9 N/m at t = 2.000 s, above its"),
        (Worst("deflection_limit", 2.0, 0.3, 0.2, "rad", 1), "deflection of spring 1 is 0.3 rad at"),
        (Worst("motor_velocity_limit", 2.0, 9.0, 8.0, "rad/s", 2), "joint-side velocity of motor 2 is 9"),
        (Worst("motor_torque_limit", 2.0, -95.0, -90.0, "N m", 2), "joint-side torque of motor 2 is -95 N m"),
    ],
    ids=lambda value: value.kind if isinstance(value, Worst) else "",
)  # fmt: skip
def test_limit_names_what_leaves_it_and_when(worst, said):
    text = sentence(troubled(worst))
    assert text.startswith(f"elbow: {said}")
    assert text.endswith(f" limit {worst.bound:g} (first at 3.588 s)")


def test_times_between_milliseconds_are_told_apart():
    fast = Worst("infeasible", 1.0000076, 790.0, 803.1, "N m/rad")
    assert "at t = 1.000008 s" in sentence(troubled(fast))


@pytest.mark.parametrize(
    ("margin", "shown"),
    [(0.2, "20.00 %"), (-0.0272, "-2.72 %"), (-6.8e-6, "-0.0007 %"), (0.0, "0.00 %"), (1.2e-10, "1e-08 %")],
)
def test_small_margins_do_not_round_to_zero(margin, shown):
    row = line(render(report(replace(QUIET, margin=margin))), "elbow ")
    assert row.endswith(f"  {shown}")


def test_peaks_next_to_a_singular_step_are_short():
    row = line(render(report(replace(QUIET, peak_tau_motor=(1.2345678e9, 98.87)))), "elbow ")
    assert "1.23e+09 / 98.9 N m" in row


def test_peak_that_never_existed_is_a_dash():
    row = line(render(report(replace(QUIET, peak_tau_motor=(NAN, NAN)))), "elbow ")
    assert "- / - N m" in row


def test_starts_of_many_joints_are_three_to_a_line():
    joints = [replace(QUIET, name=f"joint_{number}") for number in range(1, 8)]
    text = render(report(*joints))
    start = text[text.index("start motors at: ") : text.index("torque step")]
    lines = start.splitlines()
    assert [each.count(" rad") for each in lines] == [3, 3, 1]
    assert [each.endswith(",") for each in lines] == [True, True, False]
    assert {each.index("joint_") for each in lines} == {len("start motors at: ")}


def test_motors_that_move_at_an_end_are_named():
    fast = replace(QUIET, name="base", start_dtheta=(2.8, -2.75), end_dtheta=(0.0, 0.0009))
    slide = replace(QUIET, name="slide", type="prismatic", start_dtheta=(0.01, 0.0))
    text = render(report(QUIET, fast, slide))
    assert line(text, "motors move at the start") == (
        "motors move at the start: base +2.8 -2.75 rad/s, slide +0.01 +0 m/s"
    )
    assert line(text, "motors move at the end") == "motors move at the end: base +0 +0.0009 rad/s"


def test_motors_that_rest_but_for_rounding_are_not_named():
    at_rest = replace(QUIET, start_dtheta=(1e-4, -1e-17), end_dtheta=(NAN, NAN))
    held = replace(QUIET, start_dtheta=(1e-12, 1e-12), peak_dtheta=(1e-12, 1e-12))
    assert "motors move" not in render(report(at_rest, held))


def test_ends_are_missing_in_reports_that_were_written_before():
    content = report().as_json()
    for joint in content["joints"]:
        del joint["end"], joint["start"]["dtheta"], joint["peak"]["dtheta"]
    text = str(Report.from_json(content))
    assert "start motors at: elbow +0.07276 -0.05513 rad" in text
    assert "end motors" not in text


def test_start_at_an_infeasible_step_is_undefined():
    text = render(report(replace(QUIET, start_theta=(NAN, NAN), torque_step=(NAN, NAN))))
    assert line(text, "start motors") == "start motors at: elbow undefined (first step infeasible)"
    assert "torque step" not in text


def test_start_at_a_singular_step_has_no_torque_step():
    text = render(report(replace(QUIET, torque_step=(NAN, NAN))))
    assert line(text, "start motors") == "start motors at: elbow +0.07276 -0.05513 rad"
    assert "torque step" not in text


def test_warnings_and_notes_about_the_inputs_follow_the_table():
    lines = render(report(warnings=("its mass is zero",), notes=("the rate is 8 per second",))).splitlines()
    assert lines[3:5] == ["warning: its mass is zero", "note: the rate is 8 per second"]


def test_failed_self_check_warns_against_the_torques():
    text = render(report(self_check=SelfCheck(spring_residual=1e-15, ladder=3.3e-3, shaft_residual=2e-2)))
    assert text.splitlines()[0].endswith("SELF CHECK FAILED")
    assert text.splitlines()[-1] == (
        "SELF-CHECK FAILED: derivatives are off by 3.3e-03 (bound 1e-08), "
        "motors by 2.0e-02 (bound 1e-11), springs by 1.0e-15 (bound 1e-11); do not use these torques"
    )


def test_a_report_from_before_there_were_notes_is_read():
    content = report().as_json()
    del content["notes"]
    assert Report.from_json(content) == report()


@pytest.mark.parametrize("key", ["robot", "samples", "self_check", "joints"])
def test_what_lacks_what_every_report_has_is_none(key):
    content = report().as_json()
    del content[key]
    with pytest.raises(TypeError, match=f"missing 1 required positional argument: '{key}'"):
        Report.from_json(content)


def many(worst: Worst, steps: list[int]) -> list[JointReport]:
    return [replace(troubled(worst, steps=each), name=f"j{number}") for number, each in enumerate(steps)]


def test_five_joints_in_trouble_are_told_one_by_one():
    told = list(sentences(many(Worst("infeasible", 4.0, 790.0, 803.1, "N m/rad"), [5, 4, 3, 2, 1])))
    assert [sentence.partition(":")[0] for sentence in told] == ["j0", "j1", "j2", "j3", "j4"]


def test_of_many_joints_those_with_most_steps_are_told_and_none_is_left_out():
    *told, rest = sentences(many(Worst("infeasible", 4.0, 790.0, 803.1, "N m/rad"), [1, 7, 2, 9, 8, 6, 3]))
    assert [sentence.partition(":")[0] for sentence in told] == ["j1", "j3", "j4", "j5"]
    assert rest == ("also infeasible: j0 (1 step), j2 (2 steps, from 3.588 s), j6 (3 steps, from 3.588 s)")


def test_of_many_limits_those_farthest_off_are_told():
    joints = [
        replace(troubled(Worst("velocity_limit", 1.0, 3.0 + k, 3.0, "rad/s")), name=f"j{k}")
        for k in range(1, 7)
    ]
    *told, rest = sentences(joints)
    assert [sentence.partition(":")[0] for sentence in told] == ["j3", "j4", "j5", "j6"]
    assert rest == "also over the velocity limit: j1 (4 rad/s, limit 3), j2 (5 rad/s, limit 3)"


def test_of_many_joints_those_alike_are_named_together():
    steps = [2, 2, 2, 9, 8, 7, 6, 1, 2, 2]
    *_, rest = sentences(many(Worst("infeasible", 4.0, 790.0, 803.1, "N m/rad"), steps))
    assert rest.splitlines() == [
        "also infeasible: j0 to j2, j8, j9 (2 steps, from 3.588 s);",
        "                 j7 (1 step)",
    ]


def test_motors_of_many_joints_that_start_alike_are_named_together():
    joints = [replace(QUIET, name=f"j{number}") for number in range(8)]
    joints[5] = replace(joints[5], start_theta=(0.1, 0.2))
    text = render(report(*joints))
    assert "start motors at: j0 to j4, j6, j7 +0.07276 -0.05513 rad;\n" in text
    assert "                 j5 +0.1 +0.2 rad\n" in text
    assert "end motors at: j0 to j7 -0.8426 -1.24 rad\n" in text
