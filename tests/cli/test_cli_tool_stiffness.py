"""The stiffness of tools with motors held: a variable on request, report, limit, flags and fixes."""

from __future__ import annotations

import json
import shlex

import numpy as np
import pytest
import yaml
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT
from samples.studies import column
from samples.torso import ACTUATOR, SWING, torso_text

from vsacli import (
    Report,
    Wrench,
    forward_kinematics,
    inverse_dynamics,
    jacobian,
    link_torques,
    load_robot,
    load_trajectory,
    open_result,
    tip_compliance,
)
from vsacli.results.charts.tool_charts import LARGEST_ELLIPSE, tool_path

TOOLS = ("left_hand", "right_hand", "lamp")
ASKED = ("--variables", "all,tip_compliance")


@pytest.fixture
def torso(own_folder):
    """The paths of the torso and a swing of it, on which nothing is pushed."""
    (own_folder / "torso.yaml").write_text(torso_text())
    (own_folder / "swing.yaml").write_text(SWING)
    return "torso.yaml", "swing.yaml"


@pytest.fixture
def rod(own_folder):
    """An upright rod of 2 kg m on an elastic joint, a chain; it buckles below m g l = 19.62 N m/rad."""
    (own_folder / "rod.yaml").write_text(
        "format: vsacli-robot/1\nname: rod\ngravity: [0, -9.81, 0]\njoints:\n"
        "  - {name: hinge, type: revolute, dh: {a: 1, alpha: 0},\n"
        "     link: {mass: 2, com: [0, 0, 0], inertia: {xx: 0.1, yy: 0.1, zz: 0.1}},\n"
        "     actuator: {type: elastic, motor: {inertia: 0.1}, stiffness: 30}}\n"
    )
    (own_folder / "lean.yaml").write_text(
        "format: vsacli-trajectory/1\nname: lean\nduration: 1\nrate: 40\n"
        "position: {type: polynomial, degree: 7, start: 90 deg, end: 150 deg}\n"
    )
    return "rod.yaml", "lean.yaml"


@pytest.mark.slow
def test_compliance_is_computed_when_asked_for(vsacli, torso):
    outcome = vsacli("invdyn", *torso, *ASKED, "-o", "swing.h5")
    assert outcome.code == 0
    assert "smallest stiffness of tools: left_hand" in outcome.out
    assert "equal bit for bit" in vsacli("validate", "--recompute", "swing.h5").out
    robot = load_robot("torso.yaml")
    with open_result("swing.h5") as result:
        assert result.tip_compliance.shape == (41, 3, 6, 6)
        for index, name in enumerate(TOOLS):
            expected = tip_compliance(robot, result.q, result.stiffness, name)
            np.testing.assert_array_equal(result.tip_compliance[:, index], expected)
            block = expected[:, :3, :3]
            least = 1 / np.linalg.eigvalsh(block)[:, -1]
            report = result.report.tools[index]
            assert (report.name, report.required) == (name, None)
            assert report.stiffness == pytest.approx(least.min(), rel=1e-12)
            assert report.time == result.time[least.argmin()]
            along = block[least.argmin()] @ report.direction * report.stiffness
            np.testing.assert_allclose(along, report.direction, rtol=0, atol=1e-9)
        assert not result.tool_flags.any()
        kept = inverse_dynamics(robot, load_trajectory("swing.yaml", robot), tip_compliance=True)
        np.testing.assert_array_equal(result.tip_compliance, kept.tip_compliance)
        kept.save("kept.h5")
        assert result.to_xarray().identical(kept.to_xarray())
        assert Report.from_json(result.report.as_json()) == result.report
    with open_result("kept.h5") as again:
        assert set(again.variables) == set(result.variables)


WRENCHES = """wrenches:
  left_hand: {type: constant, frame: base, value: [20, -15, 25, 2, -1, 1.5]}
  lamp: {type: constant, frame: end_effector, value: [-10, 30, 5, 0, 1, -2]}
"""

STEP = 1e-4
"""Step of central differences, rad."""


def test_compliance_has_the_slope_of_gravity_and_of_the_wrench_on_each_tool(vsacli, torso):
    """At a sample in the middle; differences err by STEP^2/6 of torques that are below the stiffness."""
    with open("swing.yaml", "a") as stream:
        stream.write(WRENCHES)
    assert vsacli("invdyn", *torso, *ASKED, "-o", "swing.h5").code == 0
    robot = load_robot("torso.yaml")
    with open_result("swing.h5") as result:
        q, stiffness, compliance = (
            getattr(result, name)[17] for name in ("q", "stiffness", "tip_compliance")
        )
        wrench = result.wrench[17].reshape(3, 2, 3)
    wrench[2] = wrench[2] @ forward_kinematics(robot, q)[-1, :3, :3].T  # to base axes, which it keeps
    held = Wrench.constant(np.tile(wrench.ravel(), (len(q), 1)), ("base", None, "base"))
    ahead, behind = (
        link_torques(robot, row, wrench=held).tau_e
        for row in (q + STEP * np.eye(len(q)), q - STEP * np.eye(len(q)))
    )
    slope = (ahead - behind).T / (2 * STEP)
    for index, tool in enumerate(TOOLS):
        columns = jacobian(robot, q, "base", tool=tool)
        expected = columns @ np.linalg.inv(np.diag(stiffness) + slope) @ columns.T
        size = np.abs(expected).max()
        np.testing.assert_allclose(compliance[index], expected, rtol=0, atol=STEP**2 * size)
        of_gravity = tip_compliance(robot, q, stiffness, tool)
        assert np.abs(compliance[index] - of_gravity).max() > 1e-4 * size


def test_exports_have_a_column_for_each_entry(vsacli, torso):
    vsacli("invdyn", *torso, "--variables", "tip_compliance,tool_flags", "-o", "swing.h5")
    outcome = vsacli("export", "swing.h5", "--variables", "tip_compliance,tool_flags", "-o", "swing.csv")
    assert outcome.code == 0
    with open("swing.csv") as lines:
        header, first = (line.strip().split(",") for line in list(lines)[:2])
    assert len(header) == 1 + 3 * 36 + 3
    place = header.index("right_hand.tip_compliance_ry_fx")
    with open_result("swing.h5") as result:
        assert float(first[place]) == result.tip_compliance[0, 1, 4, 0]
    at_other_times = ("--variables", "tip_compliance", "--rate", 30, "-o", "again.csv")
    assert vsacli("export", "swing.h5", *at_other_times).code == 0
    with open("again.csv") as lines:
        assert next(lines).split(",")[place] == header[place]
        assert float(next(lines).split(",")[place]) == float(first[place])
    for ending in ("mat", "parquet"):
        assert (
            vsacli("export", "swing.h5", "--variables", "tip_compliance", "-o", f"swing.{ending}").code == 0
        )


def test_other_results_do_not_have_it(vsacli, torso):
    assert "smallest stiffness" not in vsacli("invdyn", *torso, "-o", "swing.h5").out
    with open_result("swing.h5") as result:
        assert not {"tip_compliance", "tool_flags"} & {*result.variables}
        assert "tools" not in result.report.as_json()
    refused = vsacli("invdyn", *torso, "--variables", "tool_flags", "-o", "flags.h5")
    assert (refused.code, "no tool of torso has a min_stiffness" in refused.err) == (2, True)


@pytest.mark.slow
def test_a_tool_below_its_limit_is_found_and_fixed(vsacli, torso):
    limits = {tool.name: tool.stiffness for tool in report_of(torso).tools}
    robot = yaml.safe_load(torso_text())
    robot["tools"]["left_hand"]["min_stiffness"] = bound = 1.2 * limits["left_hand"]
    robot["tools"]["lamp"]["min_stiffness"] = 0.9 * limits["lamp"]
    with open("torso.yaml", "w") as stream:
        yaml.safe_dump(robot, stream, sort_keys=False)
    outcome = vsacli("invdyn", *torso, "-o", "swing.h5")
    assert outcome.code == 3
    assert "OVER LIMIT" in outcome.out
    assert "1 of 3 tools over a limit" in outcome.out
    assert "left_hand: stiffness in the softest direction is" in outcome.out
    with open_result("swing.h5") as result:
        least = 1 / np.linalg.eigvalsh(inverse(torso).tip_compliance[:, 0, :3, :3])[:, -1]
        np.testing.assert_array_equal(result.tool_flags, np.outer(2 * (least < bound), (1, 0, 0)))
        finding = result.report.tools[0].worst["tool_stiffness_limit"]
        assert (finding.time, finding.bound) == (result.time[least.argmin()], bound)
        assert result.report.as_json()["tools"][0]["samples"]["over_limit"] == (least < bound).sum()

    outcome = vsacli("check-feasibility", *torso, "--write-fix", 1, "-o", "fixed.yaml", "--json")
    (fix,) = json.loads(outcome.out)["fixes"]["fixes"]
    (part,) = fix["stiffness_factor"]["factors"]
    assert part["joints"] == ["waist", "left_shoulder", "left_arm", "left_elbow"]
    with open("fixed.yaml") as stream:
        values = yaml.safe_load(stream)["stiffness"]["value"]
    assert values == pytest.approx([900 * part["factor"]] * 4 + [900] * 4)
    fixed = report_of(("torso.yaml", "fixed.yaml"))
    assert fixed.verdict == "ok"
    assert bound <= fixed.tools[0].stiffness <= 1.001 * bound  # a factor of four digits


@pytest.mark.slow
def test_a_tool_that_no_stiffness_helps_is_left_out_of_fixes(vsacli, torso):
    limits = ("--set", "tools.left_hand.min_stiffness=1e7", "--set", "tools.lamp.min_stiffness=1.2e5")
    stiff = ("--set", "joints.left_elbow.limits.stiffness=1000")
    outcome = vsacli("check-feasibility", *torso, *limits, *stiff, "--fixes")
    assert outcome.code == 3
    assert "the most that waist, left_shoulder, left_arm and left_elbow may have" in outcome.out
    assert "every sample of all joints and tools but left_hand" in outcome.out
    assert "1. multiply the stiffness of pole by" in outcome.out


@pytest.mark.slow
def test_factors_come_on_top_of_the_fixes_of_joints(vsacli, torso):
    limit = 1.5 * report_of(torso).tools[2].stiffness
    soft = ("--set", "stiffness.value=[900, 900, 900, 900, 900, 900, 790, 900]")
    outcome = vsacli(
        "check-feasibility", *torso, *soft, "--set", f"tools.lamp.min_stiffness={limit}", "--fixes"
    )
    assert outcome.code == 3
    assert "right_elbow: stiffness is 790 N m/rad" in outcome.out
    assert "lamp: stiffness in the softest direction is" in outcome.out
    assert "raise the stiffness of right_elbow" in outcome.out
    assert ", and multiply the stiffness of pole by" in outcome.out


def test_samples_of_infeasible_joints_have_no_compliance(torso):
    robot = load_robot(torso[0])
    soft = {"stiffness.value": [900, 900, 900, 900, 900, 900, 790, 900]}
    result = inverse_dynamics(robot, load_trajectory("swing.yaml", robot, soft), tip_compliance=True)
    assert np.isnan(result.tip_compliance[:, 1]).all()
    assert np.isfinite(result.tip_compliance[:, [0, 2]]).all()
    assert np.isnan(result.report.tools[1].stiffness)
    assert not result.tool_flags.any()


def test_a_pose_that_buckles_is_a_finding(vsacli, rod):
    outcome = vsacli("invdyn", *rod, *ASKED, "-o", "rod.h5")
    assert outcome.code == 0
    soft = ("--set", "joints.hinge.actuator.stiffness=15")
    outcome = vsacli("invdyn", *rod, *soft, *ASKED, "-o", "soft.h5")
    assert outcome.code == 3
    assert "end_effector: its pose is statically unstable at t = 0.000 s" in outcome.out
    with open_result("soft.h5") as result:
        unstable = 2 * 9.81 * np.sin(result.q[:, 0]) >= 15
        np.testing.assert_array_equal(result.tool_flags[:, 0], unstable)
        np.testing.assert_array_equal(np.isnan(result.tip_compliance[:, 0, 0, 0]), unstable)
        assert result.report.verdict == "singular"
    assert vsacli("check-feasibility", *rod, *soft).code == 0  # not asked for


@pytest.mark.parametrize(("tool", "tools"), [("tip", "tools: {tip: {joint: hinge}}\n"), ("end_effector", "")])
def test_the_hint_of_an_unstable_pose_leads_to_its_fixes(vsacli, rod, tool, tools):
    soft = ("--set", "joints.hinge.actuator.stiffness=15")
    with open("rod.yaml", "a") as stream:
        stream.write(tools)
    outcome = vsacli("invdyn", *rod, *soft, *ASKED, "-o", "tip.h5")
    (hint,) = (line for line in outcome.out.splitlines() if line.startswith("to list fixes"))
    listed = vsacli(*shlex.split(hint.partition(": vsacli ")[2]))
    assert listed.code == 3
    assert f"\n{tool}: its pose is statically unstable" in listed.out
    assert f"no joint that moves {tool} has a stiffness to choose" in listed.out


BOTH_ARMS = (
    *(REPOSITORY / folder / "torso_2x3r.yaml" for folder in ("robots", "trajectories")),
    *("--set", "rate=10"),
)
"""The torso of the examples, with an elastic waist."""


@pytest.mark.slow
@pytest.mark.parametrize("limited", ["left_hand", "right_hand", "*"])
def test_the_arm_that_buckles_is_stiffened_whichever_tool_is_limited(vsacli, limited):
    """The stretched left arm is pushed along its length, towards the shoulder."""
    changes = (
        f"tools.{limited}.min_stiffness=10",
        "position={type: constant, value: 0}",
        "gravity=[0,0,-0.001]",
        "wrenches={left_hand: {type: constant, frame: base, value: [-300,0,0,0,0,0]}}",
    )
    options = [word for change in changes for word in ("--set", change)]
    outcome = vsacli("check-feasibility", *BOTH_ARMS, *options, "--fixes")
    assert outcome.code == 3
    assert "right_hand: its pose is statically unstable" in outcome.out
    assert "with any of them every sample has a margin" in outcome.out
    joints = "left_shoulder_lift, left_shoulder_swing and left_elbow"
    assert f"\n1. multiply the stiffness of {joints} by " in outcome.out


@pytest.mark.slow
def test_a_tool_without_stiffness_to_choose_has_no_fix(vsacli):
    hand = "{joint: left_elbow}, right_hand: {joint: right_elbow}"
    chest = "{joint: waist, xyz: [0.1, 0, 0], min_stiffness: 1e6}"
    tools = ("--set", f"tools={{left_hand: {hand}, chest: {chest}}}")
    outcome = vsacli("check-feasibility", *BOTH_ARMS, *tools, "--fixes")
    assert outcome.code == 3
    assert "no joint that moves chest has a stiffness to choose" in outcome.out


SPRUNG_POLE = ("--set", "joints.pole.actuator={type: elastic, motor: {inertia: 0.1}, stiffness: 100}")


@pytest.mark.slow
def test_tools_of_rigid_joints_do_not_yield(vsacli, own_folder):
    rigid = torso_text().replace(ACTUATOR, "{type: rigid, motor: {inertia: 0.1}}")
    (own_folder / "rigid.yaml").write_text(rigid)
    (own_folder / "swing.yaml").write_text(SWING.replace("stiffness: {type: constant, value: 900}\n", ""))
    outcome = vsacli("invdyn", "rigid.yaml", "swing.yaml", *ASKED, "-o", "rigid.h5", "--plot", "drawn")
    assert outcome.code == 0
    assert "stiffness of tools: left_hand does not yield, right_hand does not yield, lamp" in outcome.out
    assert "tool" not in outcome.err
    with open_result("rigid.h5") as result:
        assert result.report.as_json()["tools"][0]["stiffness"]["rigid"] is True
        assert all(tool.rigid for tool in result.report.tools)
    assert "tool" not in vsacli("plot", "rigid.h5", "-o", "again").err
    outcome = vsacli("invdyn", "rigid.yaml", "swing.yaml", *ASKED, "-o", "pole.h5", *SPRUNG_POLE)
    assert "right_hand does not yield, lamp" in outcome.out
    assert "N/m at" in outcome.out


def inverse(files):
    robot = load_robot(files[0])
    return inverse_dynamics(robot, load_trajectory(files[1], robot), tip_compliance=True)


def report_of(files):
    return inverse(files).report


@pytest.mark.slow
def test_figures_show_stiffness_and_path_of_tools(vsacli, torso):
    names = ["motion", "motor-torque", "elastic-torque", "energy", "tool-stiffness", "tool-path"]
    outcome = vsacli("invdyn", *torso, *ASKED, "-o", "swing.h5", "--plot", "drawn")
    assert outcome.err.split() == [
        "wrote",
        "swing.h5",
        *(word for name in names for word in ("wrote", f"drawn/swing-{name}.png")),
    ]
    with open_result("swing.h5") as result:
        figures = result.plot()
        compliance = result.tip_compliance
    over_time = figures["tool-stiffness"].axes[0]
    assert list(figures) == names
    assert [axes.get_title(loc="left") for axes in figures["tool-stiffness"].axes] == [
        "stiffness in the softest direction",
        *(f"softest direction of {tool}" for tool in TOOLS),
    ]
    assert tuple(text.get_text() for text in over_time.get_legend().texts) == TOOLS
    for index, line in enumerate(over_time.lines):
        least = 1 / np.linalg.eigvalsh(compliance[:, index, :3, :3])[:, -1]
        np.testing.assert_allclose(line.get_ydata(), least, rtol=1e-12)  # rounding of eigenvalues
    of_elbow = vsacli("plot", "swing.h5", "--joints", "left_elbow", "-o", "elbow")
    assert "tool" not in of_elbow.err
    assert vsacli("plot", "swing.h5", "--variables", "tip_compliance", "-o", "elbow").code == 2


def test_ellipses_are_displacements_by_a_force(torso):
    result = inverse(torso)
    result.save("swing.h5")
    with open_result("swing.h5") as stored:
        path = tool_path(stored, "swing")
    force = path.force / np.array([1, 2, 5])
    assert np.any(np.log10(force) == np.round(np.log10(force)))
    np.testing.assert_allclose(path.displacements[1, 0], path.force * result.tip_compliance[0, 1, :3, :3])
    largest = np.linalg.norm(path.displacements, ord=2, axis=(-2, -1)).max() / path.size
    assert LARGEST_ELLIPSE / 2.5 < largest <= LARGEST_ELLIPSE
    poses = forward_kinematics(load_robot("torso.yaml"), result.q)
    np.testing.assert_allclose(path.paths["lamp"], poses[:, -1, :3, 3], rtol=0, atol=1e-15)


def test_an_optimization_refuses_a_limit_that_it_does_not_keep(vsacli, torso):
    found = vsacli("optimize", *torso, "--set", "tools.left_hand.min_stiffness=300")
    assert found.code == 2
    assert "do not keep the min_stiffness of tools (left_hand)" in found.err
    assert "a lower bound by limits.stiffness, which is kept" in found.err
    assert "check-feasibility --fixes of the optimized motion may help as well" in found.err


@pytest.mark.slow
def test_simulations_judge_tools_on_simulated_values(vsacli):
    """Feedforward follows the motion, so that the tools are as stiff as along the command."""
    inputs = [REPOSITORY / folder / "hand_3x2r.yaml" for folder in ("robots", "trajectories")]
    limited = ("--set", "tools.index_tip.min_stiffness=100")
    commanded = vsacli("check-feasibility", *inputs, *limited, "--json")
    simulated = vsacli("simulate", *inputs, *limited, "-o", "grasp.h5", "--json")
    assert commanded.code == simulated.code == 3
    expected, report = json.loads(commanded.out), json.loads(simulated.out)
    assert report["verdict"] == "over_limit"
    assert [each["name"] for each in report["tools"]] == ["index_tip", "middle_tip", "thumb_tip"]
    worst, of_command = (each["tools"][0]["worst"]["tool_stiffness_limit"] for each in (report, expected))
    assert worst["value"] == pytest.approx(of_command["value"], rel=1e-6)  # rtol of the integration
    assert report["tools"][0]["samples"] == expected["tools"][0]["samples"]
    shown = vsacli("info", "grasp.h5")
    assert "1 of 3 tools over a limit" in shown.out
    assert "tools" not in json.loads(vsacli("simulate", *inputs, "--json").out)


def test_a_study_names_the_tool_that_is_too_soft_first(vsacli, own_folder):
    (own_folder / "tips.yaml").write_text(
        f"format: vsacli-study/1\nname: tips\nrobot: {REPOSITORY / 'robots' / 'hand_3x2r.yaml'}\n"
        f"trajectory: {REPOSITORY / 'trajectories' / 'hand_3x2r.yaml'}\n"
        "vary: {tools.index_tip.min_stiffness: [50, 100]}\nkeep: [margin]\n"
    )
    done = vsacli("study", "tips.yaml", "-o", "tips.h5")
    assert "1 ok, 1 over limit" in done.out
    assert column("tips.h5", "first_limit").tolist() == ["", "index_tip tool_stiffness_limit"]


@pytest.mark.slow
def test_analyses_that_do_not_judge_tools_say_so(vsacli, own_folder):
    limited = (REPOSITORY / "robots" / "hand_3x2r.yaml").read_text()
    limited = limited.replace("{joint: index_middle}", "{joint: index_middle, min_stiffness: 100}")
    (own_folder / "hand.yaml").write_text(limited)
    motion = REPOSITORY / "trajectories" / "hand_3x2r.yaml"
    for command in ("size", "sensitivity"):
        assert "min_stiffness of index_tip is not judged here" in vsacli(command, "hand.yaml", motion).out
        plain = vsacli(command, REPOSITORY / "robots" / "hand_3x2r.yaml", motion).out
        assert "min_stiffness" not in plain


def test_what_infeasible_samples_lack_is_said(vsacli):
    """Minima and sums skip these samples in silence otherwise, and look like those of the motion."""
    feasible = ("smallest stiffness of tools: end_effector", "co-contraction: up to")
    infeasible = (
        "smallest stiffness of tools over feasible samples: end_effector",
        "co-contraction of joints computed throughout: up to 67.",
    )
    for start, lines in ((850, feasible), (795, infeasible)):
        changes = ("--set", "rate=50", "--set", f"stiffness.start.elbow={start}")
        out = vsacli("invdyn", ROBOT, REST_TO_REST, *changes, *ASKED, "-o", f"{start}.h5").out
        assert [line in out for line in lines] == [True, True], out
