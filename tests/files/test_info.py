"""`vsacli info`: numbers against independent ones, and the shape of what is printed."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY, ROBOT, rest_to_rest, without_hint
from samples.marks import slow, slow_but

from vsacli import Joint, Limits, Pose, Robot, link_torques, load_robot, load_trajectory
from vsacli.files.info.robot_info import describe_robot, free_range, reach, reach_bounds, static_load
from vsacli.files.info.trajectory_info import describe_trajectory
from vsacli.robot.kinematics import frames

ARM = load_robot(ROBOT)
NAMES = sorted(path.stem for path in (REPOSITORY / "robots").glob("*.yaml"))
SLIDE = load_robot(REPOSITORY / "robots" / "rp_2.yaml")
G = 9.81


def limited(robot: Robot, *positions: tuple[float, float]) -> Robot:
    """The robot with other position limits."""
    joints = zip(robot.joints, positions, strict=True)
    return dataclasses.replace(
        robot,
        joints=tuple(dataclasses.replace(joint, limits=Limits(position=each)) for joint, each in joints),
    )


def transform(joint: Joint, q: float) -> np.ndarray:
    """Rz Tz Tx Rx written out as 4x4 matrices."""
    theta = joint.dh.theta + (q if joint.is_revolute else 0)
    d = joint.dh.d + (0 if joint.is_revolute else q)
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(joint.dh.alpha), math.sin(joint.dh.alpha)
    about_z = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
    about_x = np.array([[1, 0, 0, joint.dh.a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
    return about_z @ about_x


@pytest.mark.parametrize("name", ["rp_2", "panda_7r", "scara_4"])
def test_the_tip_is_where_the_transforms_put_it(name: str) -> None:
    robot = load_robot(REPOSITORY / "robots" / f"{name}.yaml")
    robot = dataclasses.replace(robot, tool=Pose(xyz=(0.1, -0.2, 0.3)))
    q = np.random.default_rng(1).uniform(-2, 2, (5, len(robot.joints)))
    for configuration, tip in zip(q, frames(robot, q).tools[0].origin, strict=True):
        chain = np.linalg.multi_dot(
            [*map(transform, robot.joints, configuration), np.array([0.1, -0.2, 0.3, 1.0])]
        )
        np.testing.assert_allclose(tip, chain[:3], atol=1e-13)  # rounding of lengths of about 1 m


def test_reach_of_a_planar_chain_is_the_sum_of_its_links() -> None:
    assert reach(ARM).values[0] == pytest.approx(0.6, abs=1e-12)
    assert reach_bounds(ARM)[0] == pytest.approx(0.6, abs=1e-12)


def test_reach_within_limits_by_the_law_of_cosines() -> None:
    bent = limited(ARM, (-1, 1), (-1, 1), (1.0, 2.0))
    assert reach(bent).values[0] == pytest.approx(0.6 * math.cos(0.5), abs=1e-9)
    assert reach(bent).configurations[0, 2] == pytest.approx(1.0)
    assert reach_bounds(bent)[0] == pytest.approx(0.6)


def test_reach_of_a_slide_is_at_the_end_of_its_range() -> None:
    assert reach(SLIDE).values[0] == pytest.approx(0.3 + 0.3)
    assert reach(SLIDE).configurations[0, 1] == 0.3


def recursion_torques(robot: Robot, q: np.ndarray) -> np.ndarray:
    still = np.zeros_like(q)
    return link_torques(robot, q, still, still, still, still)[0]


def test_static_load_of_the_published_arm_is_that_of_the_stretched_one() -> None:
    # Table I: links 2 and 3 of 6.7858 and 5.0894 kg, 0.3 m long, centers in the middle
    elbow = 5.0894 * G * 0.15
    shoulder = 6.7858 * G * 0.15 + 5.0894 * G * 0.45
    np.testing.assert_allclose(static_load(ARM).values, [0, shoulder, elbow], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", ["panda_7r", "puma_560", "lwr_7r_vsa", "rp_2", "scara_4"])
def test_no_random_configuration_beats_the_extremes(name: str) -> None:
    robot = load_robot(REPOSITORY / "robots" / f"{name}.yaml")
    low, high = np.array([free_range(joint) for joint in robot.joints]).T
    q = np.random.default_rng(2).uniform(low, high, (20_000, len(robot.joints)))
    loads, farthest = static_load(robot), reach(robot)
    rounding = 1e-9  # the search ends within 1e-13 of its maximum, in relative terms
    sampled = np.abs(recursion_torques(robot, q)).max(axis=0)
    assert (sampled <= loads.values + rounding).all()
    assert (sampled >= 0.7 * loads.values - rounding).all()  # and the samples come near
    distance = np.linalg.norm(frames(robot, q).tools[0].origin, axis=1).max()
    assert 0.8 * farthest.values[0] <= distance <= farthest.values[0] + rounding
    assert farthest.values[0] <= reach_bounds(robot)[0] + rounding
    assert ((low <= loads.configurations) & (loads.configurations <= high)).all()
    own = np.abs(np.diagonal(recursion_torques(robot, loads.configurations)))
    np.testing.assert_allclose(own, loads.values, atol=1e-9)


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ((-math.inf, math.inf), (-math.pi, math.pi)),
        ((-1, math.inf), (-1, -1 + 2 * math.pi)),
        ((-math.inf, 1), (1 - 2 * math.pi, 1)),
        ((-9, 9), (-9, 9)),
    ],
)
def test_range_of_a_revolute_joint(limits: tuple[float, float], expected: tuple[float, float]) -> None:
    assert free_range(limited(ARM, limits, limits, limits).joints[0]) == pytest.approx(expected)


def test_a_slide_without_limits_is_held_at_zero_and_named() -> None:
    free = limited(SLIDE, (-math.inf, math.inf), (-math.inf, math.inf))
    assert describe_robot(free)["held_at_zero"] == ["slide"]
    assert reach(free).values[0] == pytest.approx(0.3)


def test_stiffness_ranges_are_those_of_cubic_springs() -> None:
    joints = describe_robot(ARM)["joints"]
    for joint in joints:
        unloaded, loaded = (joint["stiffness_range"][name] for name in ("unloaded", "loaded"))
        assert unloaded == [pytest.approx(800), math.inf]  # 2 K of Table I
        # equal deflections carry the load alone: tau = 2 (K phi + Kc phi^3) at the least stiffness
        phi = np.roots([2 * 2000, 0, 2 * 400, -joint["static_load"]["torque"]])
        least = 2 * (400 + 3 * 2000 * phi[np.isreal(phi)].real[0] ** 2)
        assert loaded == [pytest.approx(least), math.inf]


def test_other_joints_have_the_stiffness_of_their_spring_or_none() -> None:
    robot = load_robot(REPOSITORY / "robots" / "mixed_3r.yaml")
    base, shoulder, elbow = (joint["stiffness_range"] for joint in describe_robot(robot)["joints"])
    assert (base, shoulder) == ({}, {"unloaded": [1000, 1000], "loaded": [1000, 1000]})
    assert elbow["unloaded"] == [800, math.inf]


def test_every_declared_number_of_a_robot_is_there() -> None:
    description = describe_robot(SLIDE)
    arm = description["joints"][0]
    assert arm["link"]["inertia"]["xy"] == SLIDE.joints[0].link.inertia.xy
    assert arm["actuator"]["type"] == "antagonistic"
    assert arm["actuator"]["spring"][1] == {
        "type": "cubic",
        "max_deflection": math.inf,
        "k": 400,
        "k_c": 2000,
    }
    assert description["mass"] == 7


def test_peaks_of_a_polynomial_are_the_published_ones() -> None:
    trajectory = load_trajectory(REPOSITORY / "trajectories" / "rest_to_rest.yaml", ARM)
    description = describe_trajectory(trajectory, ARM.joint_names)
    base = description["joints"][0]
    travel, duration = math.pi / 2, 4.0
    assert base["name"] == "base"
    assert base["q"] == {"min": 0, "max": pytest.approx(travel), "peak": pytest.approx(travel)}
    assert base["dq"]["peak"] == pytest.approx(35 / 16 * travel / duration)  # of 35s^4-84s^5+70s^6-20s^7
    assert base["d4q"]["peak"] == pytest.approx(840 * travel / duration**4)  # at both ends
    assert (description["samples"], description["duration"]) == (4001, 4)


def test_ranges_go_over_all_blocks() -> None:
    """Extremes are at start, middle and end, of which 8192 samples are less than a half."""
    path = REPOSITORY / "trajectories" / "rest_to_rest.yaml"
    few, many = (load_trajectory(path, ARM, {"rate": rate}) for rate in (100, 5000))
    for name in ("q", "dq", "d4q", "stiffness"):
        coarse, fine = (describe_trajectory(each, ARM.joint_names)["joints"][1][name] for each in (few, many))
        assert fine == pytest.approx(coarse)


def test_robot_on_the_command_line(vsacli: Any) -> None:
    done = vsacli("info", ROBOT)
    assert (done.code, done.err) == (0, "")
    assert "robot vsa-3r: 3 joints, 20.923 kg\n" in done.out
    assert "reach 0.6 m from the origin of DH frame 0; bound 0.6 m\n" in done.out
    assert (
        "shoulder   antagonistic     cubic    32.452 N m   from 800 N m/rad   springs, none"
        "   from 819.43 N m/rad   springs, none" in done.out
    )
    described = json.loads(vsacli("info", ROBOT, "--json").out)
    assert described["joints"][2]["link"]["mass"] == 5.0894
    assert described["joints"][0]["stiffness_range"]["unloaded"] == [800, None]
    assert vsacli("info", ROBOT, "--field", "joints.elbow.link.mass").out == "5.0894\n"
    assert vsacli("info", ROBOT, "--field", "joints.elbow.name").out == "elbow\n"
    assert vsacli("info", ROBOT, "--field", "joints.*.name").out == '["base", "shoulder", "elbow"]\n'
    assert vsacli("info", ROBOT, "--field", "joints.1.stiffness_range.unloaded.1").out == "null\n"


def test_a_field_that_is_not_there(vsacli: Any) -> None:
    done = vsacli("info", ROBOT, "--field", "joint")
    assert (done.code, done.out) == (2, "")
    assert "--field: there is no 'joint'; did you mean 'joints'?" in done.err


def test_trajectory_on_the_command_line(vsacli: Any) -> None:
    path = REPOSITORY / "trajectories" / "rest_to_rest.yaml"
    alone, named = vsacli("info", path), vsacli("info", path, "--robot", ROBOT)
    assert (alone.code, named.code) == (0, 0)
    assert "joint_1" in alone.out
    assert "shoulder" in named.out
    assert "trajectory rest-to-rest: 4001 samples, 4 s from t = 0 s" in named.out


def test_lists_beside_names_need_the_robot(vsacli: Any) -> None:
    path = REPOSITORY / "trajectories" / "mixed_3r.yaml"
    alone = vsacli("info", path)
    assert alone.code == 2
    hint = "which is which in its lists; name the robot with --robot ROBOT"
    assert hint in alone.err
    robot = REPOSITORY / "robots" / "mixed_3r.yaml"
    assert vsacli("info", path, "--robot", robot).code == 0


def test_result_on_the_command_line(vsacli: Any, feasible_result: Path) -> None:
    done = vsacli("info", feasible_result)
    assert (done.code, done.err) == (0, "")
    assert f"input {ROBOT}, SHA-256 " in done.out
    described = json.loads(vsacli("info", feasible_result, "--json").out)
    assert described["verdict"] == described["report"]["verdict"] == "ok"
    assert described["provenance"]["versions"]["vsacli"]
    torque = next(each for each in described["variables"] if each["name"] == "tau_motor")
    assert torque == {
        "name": "tau_motor",
        "dims": ["time", "joint", "motor"],
        "units": "N m",
        "meaning": torque["meaning"],
    }
    assert vsacli("info", feasible_result, "--field", "report.joints.elbow.samples.infeasible").out == "0\n"


@pytest.mark.cases(1)
@pytest.mark.parametrize("end_stiffness", [1275, 790], ids=["feasible", "infeasible"])
@pytest.mark.parametrize("options", ["", slow("--deflection-solver ode"), "--stop-on-infeasible"])
def test_a_result_ends_with_what_invdyn_printed(
    vsacli: Any, tmp_path: Path, end_stiffness: float, options: str
) -> None:
    motion = rest_to_rest(tmp_path / "move.yaml", end_stiffness)
    printed = vsacli("invdyn", ROBOT, motion, "-o", "r.h5", *options.split()).out
    assert ("to list fixes: " in printed) == (end_stiffness == 790)
    assert vsacli("info", "r.h5").out.endswith(f"\n\n{without_hint(printed)}")


def test_so_does_that_of_joints_of_every_kind(vsacli: Any) -> None:
    files = [REPOSITORY / folder / "mixed_3r.yaml" for folder in ("robots", "trajectories")]
    printed = vsacli("invdyn", *files, "-o", "r.h5").out
    assert printed
    assert vsacli("info", "r.h5").out.endswith(f"\n\n{printed}")


def test_simulation_on_the_command_line(vsacli: Any, motion: Path) -> None:
    motion.write_text(motion.read_text().replace("duration: 4.0", "duration: 0.5"))
    assert vsacli("simulate", ROBOT, motion, "-q", "-o", "s.h5").code in (0, 3)
    done = vsacli("info", "s.h5")
    assert done.code == 0
    assert done.out.startswith("simulation of vsa-3r, ")
    assert json.loads(vsacli("info", "s.h5", "--json").out)["kind"] == "simulation"


def test_other_kinds_are_refused(vsacli: Any) -> None:
    done = vsacli("info", REPOSITORY / "robots" / "desk_arm.urdf")
    assert done.code == 2
    assert "desk_arm.urdf: is a URDF; make a robot file of it: vsacli import-urdf " in done.err


@pytest.mark.parametrize("name", slow_but(NAMES[::3], NAMES))
def test_every_robot_that_comes_along_is_described(vsacli: Any, name: str) -> None:
    done = vsacli("info", REPOSITORY / "robots" / f"{name}.yaml")
    assert done.code == 0
    table = [list(lines) for _, lines in itertools.groupby(done.out.splitlines(), bool)]
    assert len(table) >= 7


def test_the_cache_is_shown_and_emptied(
    vsacli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, temporary_files: Any
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "temporary").mkdir()
    temporary_files(tmp_path / "temporary")
    folder = tmp_path / "cache" / "vsacli"
    left = ".vsacli-000000000000-1-1-0123456789abcdef.tmp"
    for key in ("a", "b"):
        (folder / key).mkdir(parents=True)
        (folder / key / "program.so").write_bytes(bytes(1_500_000))
    (tmp_path / "out" / left).mkdir(parents=True)
    (tmp_path / "out" / left / "figure.png").write_bytes(bytes(20_000))
    done = vsacli("info", "--cache", "out")
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines() == [
        f"compiled code: 2 libraries, 3 MB of at most 100 MB, in {folder}",
        f"unfinished: out/{left}, 0.02 MB, of another host or container: "
        "remove it if nothing runs there any more",
    ]
    assert json.loads(vsacli("info", "--cache", "out", "--json").out) == {
        "kind": "cache",
        "folder": str(folder),
        "entries": 2,
        "size": 3_000_000,
        "limit": 100_000_000,
        "unfinished": [{"path": f"out/{left}", "size": 20_000, "owner": "elsewhere"}],
    }
    assert vsacli("info", "--cache", "--field", "entries").out == "2\n"
    assert vsacli("info", "--cache", "--clear").out.startswith("compiled code: 0 libraries, 0 MB of")
    assert not list(folder.iterdir())
    assert (tmp_path / "out" / left).is_dir()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), 2, "Error: Missing argument 'FILE'."),
        (("--clear", "x"), 2, "Error: --clear empties the cache; give --cache, too"),
        (
            ("--cache", "nowhere"),
            2,
            "nowhere: is not a folder; name one in which to look for unfinished files",
        ),
    ],
    ids=["nothing", "clear alone", "no folder"],
)
def test_ways_to_ask_for_nothing(vsacli: Any, arguments: tuple[str, ...], code: int, message: str) -> None:
    done = vsacli("info", *arguments)
    assert (done.code, done.out) == (code, "")
    assert done.err.splitlines()[-1] == message


def test_a_cache_that_cannot_be_used(vsacli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    done = vsacli("info", "--cache")
    assert (done.code, done.out) == (4, "")
    assert done.err.startswith("compiled code: there is no cache folder: ")


@pytest.mark.parametrize(
    ("signals", "stiff"),
    [
        ("stiffness: {type: constant, value: [1200, null, 800]}", [True, False, True]),
        (
            "stiffness: {type: constant, value: 900}\ndamping: {type: constant, value: [1, null, 2, null]}",
            [True] * 4,
        ),
    ],
)
def test_joints_are_counted_by_whatever_lists_them(vsacli, tmp_path, signals, stiff):
    (tmp_path / "t.yaml").write_text(
        "format: vsacli-trajectory/1\nname: t\nduration: 1\n"
        f"position: {{type: polynomial, degree: 9, start: 0, end: 1}}\n{signals}\n"
    )
    described = json.loads(vsacli("info", "t.yaml", "--json").out)
    assert [joint["stiffness"]["peak"] is not None for joint in described["joints"]] == stiff


def test_dampers_are_named(vsacli):
    for robot, line in (
        ("compact_1r", "dampers: elbow parallel to its springs, 0.5 to 12 N m s/rad"),
        ("maccepa_vd_1r", "dampers: elbow between its links, 0 to 0.00848 N m s/rad"),
    ):
        assert line in vsacli("info", REPOSITORY / "robots" / f"{robot}.yaml").out.splitlines()
    assert "damper" not in vsacli("info", REPOSITORY / "robots" / "vsa_3r.yaml").out
