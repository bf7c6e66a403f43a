"""The report as text: what it says, in how many digits, for how many steps."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

from vsacli import Report
from vsacli.analysis.joint_report import COUNTED, JointReport
from vsacli.analysis.self_check import SelfCheck
from vsacli.analysis.trouble_text import failing_joints_line, finding_lines
from vsacli.base.fitted_text import fitted
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.limits import Finding

NAN = math.nan

QUIET = JointReport(
    name="elbow",
    type="revolute",
    actuator="antagonistic",
    samples=dict.fromkeys(COUNTED, 0),
    first_time={},
    worst={},
    margin=0.0576,
    margin_time=0.1,
    attainable=(801.0983, math.inf),
    commanded_min=850.0,
    commanded_max=1275.0,
    peak_tau_e=7.55,
    peak_tau_motor=(98.871, 91.635),
    start_theta=(0.0727618, -0.0551276),
    torque_discontinuity=(0.35, 0.42),
    other_branch=False,
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


def troubled(worst: Finding, samples: int = 412, first: float = 3.588, **changes: object) -> JointReport:
    """The elbow with one kind of trouble."""
    counted = worst.kind if worst.kind in COUNTED else "over_limit"
    return replace(
        QUIET,
        samples={**QUIET.samples, counted: samples},
        first_time={worst.kind: first, counted: first},
        worst={worst.kind: worst},
        **changes,
    )


def too_soft(value: float, bound: float, **changes: object) -> JointReport:
    return troubled(Finding("infeasible", 4.0, value, bound, "N m/rad"), **changes)


def sentence(joint: JointReport) -> str:
    (only,) = finding_lines([joint], 4001)
    return only


def line(text: str, start: str) -> str:
    (only,) = [each for each in text.splitlines() if each.startswith(start)]
    return only


def test_whole_report_of_a_run_without_trouble():
    slide = replace(
        QUIET,
        name="slide",
        type="prismatic",
        attainable=(8009.5, 20000.0),
        commanded_min=9000.0,
        commanded_max=9000.0,
        start_theta=(0.0317, 0.00602),
        end_theta=(0.2317, 0.18602),
        torque_discontinuity=(0.1, 0.2),
        margin=0.11,
        energy=JointEnergy(12.04, 20.4, 11.2, 31.0, 5.0),
    )
    assert render(report(QUIET, slide)).splitlines() == [
        "OK  vsa-3r, rest-to-rest: 4001 samples, 4 s",
        "",
        "joint   peak tau_e   peak motor 1 / 2       stiffness      attainable   margin",
        "           N m | N            N m | N   N m/rad | N/m   N m/rad | N/m        %",
        "elbow         7.55        98.9 / 91.6        850-1275      from 801.1     5.76",
        "slide         7.55        98.9 / 91.6            9000      8010-20000    11.00",
        "",
        "initial motor positions: elbow +0.07276 -0.05513 rad, slide +0.0317 +0.00602 m",
        "initial torque discontinuity: 0.42 N m (elbow)",
        "final motor positions: elbow -0.8426 -1.24 rad, slide +0.2317 +0.186 m",
        "energy: motors deliver 40.8 J and recover 22.4 J; springs store up to 12.0 J (slide)",
        "co-contraction: up to 61.2 N m rms per motor (elbow); its load requires 2.84 N m",
        "self-check passed (4e-11, bound 1e-08)",
    ]


@pytest.mark.parametrize(
    ("energy", "expected"),
    [
        (JointEnergy(9.66, NAN, NAN, NAN, NAN), []),
        (
            JointEnergy(0.5, 3.0, 1.0, NAN, NAN),
            ["energy: motors deliver 3 J and recover 1 J; springs store up to 0.5 J (elbow)"],
        ),
        (JointEnergy(0.0, 3.0, 1.0, NAN, NAN), ["energy: motors deliver 3 J and recover 1 J"]),
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


def test_the_first_line_counts_the_joints_that_fail():
    limit = troubled(Finding("velocity_limit", 1.0, 4.0, 3.0, "rad/s"))
    text = render(report(too_soft(790, 803.1), QUIET, limit))
    expected = "INFEASIBLE  vsa-3r, rest-to-rest: 4001 samples, 4 s; 1 of 3 joints infeasible, 1 over a limit"
    assert text.splitlines()[0] == expected


def test_nothing_is_counted_without_failures_or_of_one_joint():
    assert failing_joints_line([QUIET, QUIET]) == ""
    assert failing_joints_line([too_soft(790, 803.1)]) == ""
    assert failing_joints_line([too_soft(790, 803.1)] * 2) == "2 of 2 joints infeasible"


@pytest.mark.parametrize(
    ("worst", "verdict"),
    [
        (Finding("singular", 1.0, 800.0, 800.0, "N m/rad"), "SINGULAR"),
        (Finding("velocity_limit", 1.0, 4.0, 3.0, "rad/s"), "OVER LIMIT"),
        (Finding("near_singular", 1.0, 801.0, 800.0, "N m/rad"), "OK"),
    ],
    ids=lambda value: value.kind if isinstance(value, Finding) else "",
)
def test_the_first_line_begins_with_the_verdict(worst, verdict):
    first = render(report(troubled(worst))).splitlines()[0]
    assert first == f"{verdict}  vsa-3r, rest-to-rest: 4001 samples, 4 s"  # the only joint is not counted


def test_the_most_critical_finding_comes_first():
    joints = [
        troubled(Finding("near_singular", 1.0, 801.0, 800.0, "N m/rad")),
        troubled(Finding("motor_torque_limit", 1.0, 95.0, 90.0, "N m", 1)),
        troubled(Finding("velocity_limit", 1.0, 4.0, 3.0, "rad/s")),
        troubled(Finding("singular", 1.0, 800.0, 800.0, "N m/rad")),
        too_soft(790, 803.1),
        too_soft(700, 803.1),
        replace(QUIET, worst={}),
    ]
    found = list(finding_lines([replace(joint, name=f"j{at}") for at, joint in enumerate(joints)], 4001))
    assert [line.partition(":")[0] for line in found] == ["j5", "j4", "j3", "j1", "j2", "j0"]


def test_joints_beyond_the_first_few_follow_in_one_line():
    joints = [replace(too_soft(700 + at, 803.1), name=f"j{at}") for at in range(6)]
    *full, others = finding_lines(joints, 412)
    assert [line.partition(":")[0] for line in full] == ["j0", "j1", "j2"]
    assert others == "also infeasible: j3 (all samples), j4 (all samples), j5 (all samples)"


def test_a_hint_follows_the_findings():
    text = report(too_soft(790, 803.1), warnings=("its mass is zero",)).as_text("to list fixes: run this")
    assert text.findings[1:] == ["to list fixes: run this", "warning: its mass is zero"]


def test_run_that_ended_early_says_so():
    headline = render(report(samples=1, complete=False)).splitlines()[0]
    assert headline == "OK  vsa-3r, rest-to-rest: 1 sample, stopped early, 4 s"


def test_infeasible_stiffness_names_time_bound_and_fix():
    assert sentence(too_soft(790, 803.1)) == (
        "elbow: stiffness 790 N m/rad at t = 4.000 s is below the minimum of 803.1 N m/rad at this load; "
        "increase it (412 samples, from 3.588 s)"
    )
    assert "is above the maximum of 1500 N m/rad at this load; decrease it" in sentence(too_soft(1600, 1500))


def test_one_sample_is_singular_in_both_senses():
    assert sentence(too_soft(790, 803.1, samples=1)).endswith("increase it (1 sample)")


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
    assert re.search(r"m of (\S+) N m/rad at this load", text)[1] == shown[1]


def test_torque_that_cannot_be_carried_has_no_bound():
    text = sentence(too_soft(790, NAN, margin=NAN, attainable=(NAN, NAN)))
    assert (
        "the springs cannot carry the elastic torque at t = 4.000 s at any stiffness; reduce the load (412"
        in text
    )
    row = line(render(report(too_soft(790, NAN, margin=NAN, attainable=(NAN, NAN)))), "elbow ")
    assert row.split()[-2:] == ["none", "none"]


def test_what_else_would_help_is_said():
    assert sentence(too_soft(790, 803.1, other_branch=True)).endswith("; the opposite branch reaches it")
    slack = too_soft(790, 803.1)
    slack = replace(slack, samples={**slack.samples, "slack": 7})
    assert sentence(slack).endswith("; a tendon goes slack at 7 samples")


def test_singular_step_says_what_is_undefined():
    text = sentence(troubled(Finding("singular", 1.25, 800.0, 800.0, "N m/rad"), samples=1))
    assert text == (
        "elbow: stiffness 800 N m/rad at t = 1.250 s is singular: "
        "motor torques are undefined at the end of the attainable range; increase it (1 sample)"
    )


def test_near_singular_step_is_a_warning():
    text = sentence(troubled(Finding("near_singular", 1.25, 800.5, 800.1, "N m/rad")))
    assert text == (
        "elbow: warning: stiffness 800.5 N m/rad at t = 1.250 s is 0.05 % from the singularity, "
        "where motor torques grow without bound (412 samples, from 3.588 s)"
    )


@pytest.mark.parametrize(
    ("worst", "said"),
    [
        (Finding("position_limit", 2.0, 1.7, 1.6, "rad"), "position is 1.7 rad at t = 2.000 s, above its"),
        (Finding("velocity_limit", 2.0, -4.0, -3.0, "m/s"), "velocity is -4 m/s at t = 2.000 s, below its"),
        (Finding("stiffness_limit", 2.0, 9.0, 8.0, "N/m"), "stiffness is 9 N/m at t = 2.000 s, above its"),
        (Finding("deflection_limit", 2.0, 0.3, 0.2, "rad", 1), "deflection of spring 1 is 0.3 rad at"),
        (Finding("motor_velocity_limit", 2.0, 9.0, 8.0, "rad/s", 2), "joint-side velocity of motor 2 is 9"),
        (Finding("motor_torque_limit", 2.0, -95.0, -90.0, "N m", 2), "joint-side torque of motor 2 is -95"),
    ],
    ids=lambda value: value.kind if isinstance(value, Finding) else "",
)  # fmt: skip
def test_limit_names_what_leaves_it_and_when(worst, said):
    text = sentence(troubled(worst))
    assert text.startswith(f"elbow: {said}")
    assert text.endswith(f" limit of {worst.bound:g} {worst.unit} (first at 3.588 s)")


def test_times_between_milliseconds_are_told_apart():
    fast = Finding("infeasible", 1.0000076, 790.0, 803.1, "N m/rad")
    assert "at t = 1.000008 s" in sentence(troubled(fast))


@pytest.mark.parametrize(
    ("margin", "shown"),
    [
        (0.2, "20.00"),
        (-0.0272, "-2.72"),
        (-15.0896, "-1509"),
        (-6.8e-6, "-0.0007"),
        (0.0, "0.00"),
        (1.2e-10, "1e-08"),
    ],
)
def test_small_margins_do_not_round_to_zero(margin, shown):
    row = line(render(report(replace(QUIET, margin=margin))), "elbow ")
    assert row.endswith(f"  {shown}")


def test_peaks_next_to_a_singular_step_are_short():
    row = line(render(report(replace(QUIET, peak_tau_motor=(1.2345678e9, 98.87)))), "elbow ")
    assert "1.23e+09 / 98.9 " in row


def test_peak_that_never_existed_is_a_dash():
    row = line(render(report(replace(QUIET, peak_tau_motor=(NAN, NAN)))), "elbow ")
    assert "- / - " in row


def test_starts_of_many_joints_are_three_to_a_line():
    joints = [replace(QUIET, name=f"joint_{number}") for number in range(1, 8)]
    text = render(report(*joints))
    start = text[text.index("initial motor positions: ") : text.index("initial torque")]
    lines = start.splitlines()
    assert [each.count(" rad") for each in lines] == [3, 3, 1]
    assert [each.endswith(",") for each in lines] == [True, True, False]
    assert {each.index("joint_") for each in lines} == {len("initial motor positions: ")}


def test_motors_that_move_at_an_end_are_named():
    fast = replace(QUIET, name="base", start_dtheta=(2.8, -2.75), end_dtheta=(0.0, 0.0009))
    slide = replace(QUIET, name="slide", type="prismatic", start_dtheta=(0.01, 0.0))
    text = render(report(QUIET, fast, slide))
    assert line(text, "initial motor velocities") == (
        "initial motor velocities: base +2.8 -2.75 rad/s, slide +0.01 +0 m/s"
    )
    assert line(text, "final motor velocities") == "final motor velocities: base +0 +0.0009 rad/s"


def test_motors_that_rest_but_for_rounding_are_not_named():
    at_rest = replace(QUIET, start_dtheta=(1e-4, -1e-17), end_dtheta=(NAN, NAN))
    held = replace(QUIET, start_dtheta=(1e-12, 1e-12), peak_dtheta=(1e-12, 1e-12))
    assert "motor velocities" not in render(report(at_rest, held))


def test_ends_are_missing_in_reports_that_were_written_before():
    content = report().as_json()
    for joint in content["joints"]:
        del joint["end"], joint["start"]["dtheta"], joint["peak"]["dtheta"]
    text = str(Report.from_json(content))
    assert "initial motor positions: elbow +0.07276 -0.05513 rad" in text
    assert "final motor" not in text


def test_start_at_an_infeasible_sample_is_undefined():
    text = render(report(replace(QUIET, start_theta=(NAN, NAN), torque_discontinuity=(NAN, NAN))))
    assert line(text, "initial") == (
        "initial motor positions: undefined, since the first sample is infeasible at every joint"
    )
    assert "discontinuity" not in text
    some = render(report(QUIET, replace(QUIET, name="base", start_theta=(NAN, NAN))))
    assert "base undefined (first sample infeasible)" in line(some, "initial motor positions")


def test_start_at_a_singular_sample_has_no_torque_discontinuity():
    text = render(report(replace(QUIET, torque_discontinuity=(NAN, NAN))))
    assert line(text, "initial") == "initial motor positions: elbow +0.07276 -0.05513 rad"
    assert "discontinuity" not in text


def test_a_torque_discontinuity_of_rounding_is_not_printed():
    assert "discontinuity" not in render(report(replace(QUIET, torque_discontinuity=(5e-13, 0.0))))


def test_warnings_and_notes_about_the_inputs_follow_the_findings():
    lines = render(report(warnings=("its mass is zero",), notes=("the rate is 8 per second",))).splitlines()
    assert lines[1:3] == ["warning: its mass is zero", "note: the rate is 8 per second"]


def test_a_question_about_an_input_comes_before_what_may_follow_from_it():
    warnings = ("its mass is zero", "stiffness = 14.8 N m/rad is low; did you mean 14.8 N m/deg?")
    found = report(too_soft(790, 803.1), warnings=warnings).as_text().findings
    assert [line.partition(":")[0] for line in found] == ["warning", "elbow", "warning"]
    assert found[0] == f"warning: {warnings[1]}"


def test_a_problem_of_the_motors_is_listed_with_its_samples():
    worst = Finding("not_finite", 1.0, NAN, NAN, "N m")
    joints = [troubled(worst, samples=7) for _ in range(5)]
    counted = [replace(each, samples={**each.samples, "infeasible": 7}) for each in joints]
    dated = [replace(each, name=f"j{at}", first_time={"infeasible": 1.0}) for at, each in enumerate(counted)]
    *_, rest = finding_lines(dated, 4001)
    assert rest == "also not finite: j3 (7 samples, from 1.000 s), j4 (7 samples, from 1.000 s)"


def test_failed_self_check_warns_against_the_torques():
    text = render(report(self_check=SelfCheck(spring_residual=1e-15, ladder=3.3e-3, shaft_residual=2e-2)))
    assert text.splitlines()[0].startswith("SELF CHECK FAILED  ")
    assert text.splitlines()[1] == (
        "do not use these torques: the self-check failed; relative residuals are 0.003 of derivatives "
        "(bound 1e-08), 0.02 of motors (bound 1e-11), 1e-15 of springs (bound 1e-11)"
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


def many(worst: Finding, samples: list[int]) -> list[JointReport]:
    return [replace(troubled(worst, each), name=f"j{number}") for number, each in enumerate(samples)]


def test_four_joints_with_a_problem_have_a_sentence_each():
    found = list(finding_lines(many(Finding("infeasible", 4.0, 790.0, 803.1, "N m/rad"), [4, 3, 2, 1]), 4001))
    assert [sentence.partition(":")[0] for sentence in found] == ["j0", "j1", "j2", "j3"]


def test_of_many_joints_those_with_most_samples_come_first_and_none_is_left_out():
    worst = Finding("infeasible", 4.0, 790.0, 803.1, "N m/rad")
    *full, rest = finding_lines(many(worst, [1, 7, 2, 9, 8, 6, 3]), 4001)
    assert [sentence.partition(":")[0] for sentence in full] == ["j3", "j4", "j1"]
    assert rest == (
        "also infeasible: j0 (1 sample), j2 (2 samples, from 3.588 s), j5 (6 samples, from 3.588 s),\n"
        "                 j6 (3 samples, from 3.588 s)"
    )


def test_of_many_limits_those_farthest_exceeded_come_first():
    joints = [
        replace(troubled(Finding("velocity_limit", 1.0, 3.0 + k, 3.0, "rad/s")), name=f"j{k}")
        for k in range(1, 6)
    ]
    *full, rest = finding_lines(joints, 4001)
    assert [sentence.partition(":")[0] for sentence in full] == ["j5", "j4", "j3"]
    assert rest == "also beyond the velocity limit (rad/s): j1 4 > 3, j2 5 > 3"


def test_of_many_joints_equal_ones_are_named_together():
    samples = [2, 2, 2, 9, 8, 7, 1, 2, 2]
    *_, rest = finding_lines(many(Finding("infeasible", 4.0, 790.0, 803.1, "N m/rad"), samples), 4001)
    assert rest.splitlines() == [
        "also infeasible: j0 to j2, j7, j8 (2 samples, from 3.588 s);",
        "                 j6 (1 sample)",
    ]


def test_where_sentences_are_many_only_the_worst_joint_of_each_kind_has_one():
    joints = many(Finding("infeasible", 4.0, 790.0, 803.1, "N m/rad"), [1, 3, 2, 1])
    limits = {
        f"{name}_limit": Finding(f"{name}_limit", 1.0, 4.0, 3.0, "rad")
        for name in ("position", "velocity", "deflection")
    }
    three = [replace(joint, worst={**joint.worst, **limits}) for joint in joints[:3]]
    dated = [replace(joint, first_time={**joint.first_time, **dict.fromkeys(limits, 0.5)}) for joint in three]
    assert len(list(finding_lines([*dated, joints[3]], 4001))) == 4 + 3 * 3 - 5  # 13 would be too many
    few = [*dated[:2], replace(dated[2], worst=joints[2].worst), joints[3]]
    assert len(list(finding_lines(few, 4001))) == 4 + 3 * 2


def test_limits_of_both_types_of_joints_keep_their_units():
    units = ("m/s", "rad/s", "m/s", "rad/s", "rad/s")
    excesses = [Finding("velocity_limit", 1.0, 4.0 + at, 3.0, unit) for at, unit in enumerate(units)]
    *_, rest = finding_lines(
        [replace(troubled(each), name=f"j{at}") for at, each in enumerate(excesses)], 4001
    )
    assert rest == "also beyond the velocity limit: j0 4 > 3 m/s, j1 5 > 3 rad/s"


LONG_NAMES = (
    *("shoulder_yaw", "shoulder_pitch", "arm_roll", "elbow"),
    *("forearm_roll", "wrist_pitch", "flange"),
)


@pytest.mark.parametrize("warned", [False, True], ids=["infeasible and over limits", "near-singular, too"])
def test_the_longest_report_of_seven_joints_fits_on_a_page(warned):
    """Every joint fails in every way that an antagonistic joint can, by other amounts at other times."""
    limits = ["position", "velocity", "stiffness", "deflection", "motor_velocity", "motor_torque"]
    limits += ["current", "voltage"]
    joints = []
    for at, name in enumerate(LONG_NAMES):
        worst = {"infeasible": Finding("infeasible", 0.123456, 1234.5 + at, 1603.2 + at, "N m/rad")}
        if warned:
            worst["near_singular"] = Finding("near_singular", 0.765, 1605.5 + at, 1603.2 + at, "N m/rad")
        for number, kind in enumerate(f"{limit}_limit" for limit in limits):
            worst[kind] = Finding(
                kind, 1.234 + at, -12.345 - at, -0.0123, "N m/rad", 2 if number > 2 else None
            )
        joints.append(
            replace(
                QUIET,
                name=name,
                worst=worst,
                samples={
                    **QUIET.samples,
                    "infeasible": 712 + at,
                    "near_singular": 51 + at,
                    "over_limit": 900,
                },
                first_time=dict.fromkeys(worst, 0.123 + at),
                margin=-15.0896,
                peak_tau_motor=(21581.7, 10695.8),
                commanded_max=2400.0,
                start_theta=(NAN, NAN),
                end_theta=(0.968 + at, -0.6028 - at),
                end_dtheta=(0.0123 + at, -0.0123 - at),
            )
        )
    hint = "to list fixes: vsacli check-feasibility robots/lwr_7r_vsa.yaml trajectories/lwr_7r.yaml --fixes"
    lines = fitted(str(report(*joints).as_text(hint)), 80).splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 80


def test_motors_of_many_joints_that_start_equal_are_named_together():
    joints = [replace(QUIET, name=f"j{number}") for number in range(8)]
    joints[5] = replace(joints[5], start_theta=(0.1, 0.2))
    text = render(report(*joints))
    assert "initial motor positions: j0 to j4, j6, j7 +0.07276 -0.05513 rad;\n" in text
    assert "                         j5 +0.1 +0.2 rad\n" in text
    assert "final motor positions: j0 to j7 -0.8426 -1.24 rad\n" in text


def test_a_column_has_one_number_format():
    """Next to a singular sample, torques have exponents; so have those of the other joints."""
    huge = replace(QUIET, name="wrist", peak_tau_motor=(2.96e8, 8570501.0))
    text = render(report(QUIET, huge))
    assert line(text, "wrist").split()[2:5] == ["2.96e+08", "/", "8.57e+06"]
    assert line(text, "elbow").split()[2:5] == ["98.9", "/", "91.6"]
