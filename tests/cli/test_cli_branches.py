"""Branches give the same in any order of their file; one on the base gives what it gives alone."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.branch_order import TreeFiles, differences, write_branches, write_hand, write_orders
from samples.command_line import Outcome
from samples.generated_code import STRICT, compile_c

pytestmark = pytest.mark.cases(5)

QUICK = 4
"""Joints of the trees of quick tests."""

EVERY_TREE = range(50)

TREES = {
    "check-feasibility": EVERY_TREE,
    "validate": EVERY_TREE,
    "sensitivity": range(50, 60),
    "size": range(60, 70),
    "optimize": range(70, 74),
}
"""Seeds of the trees that a command with a report gets; fewer of one that searches."""

SOFT = "finger_3_joint_1"
"""A joint of one finger, whose commanded stiffness its springs do not have."""

SHARES = {"optimize": 1.5, "sensitivity": 1.5, "size": 1.5}
"""Stiffness over what most joints attain; by default some of them are infeasible."""


def compare_orders(
    vsacli: Callable[..., Outcome], orders: tuple[TreeFiles, TreeFiles], command: str, *options: str
) -> None:
    """Run a command on files of both orders, whose reports must agree."""
    first, second = (vsacli(command, *files, *options, "--json") for files in orders)
    assert first.code == second.code
    assert first.code in (0, 3), first.err
    assert list(differences(json.loads(first.out), json.loads(second.out))) == []


@pytest.mark.slow
def test_another_order_of_the_branches_gives_the_same_report(vsacli: Callable[..., Outcome]) -> None:
    compare_orders(vsacli, write_orders(8, QUICK), "check-feasibility")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "seed"), [(name, seed) for name, seeds in TREES.items() for seed in seeds]
)
def test_another_order_of_many_trees(vsacli: Callable[..., Outcome], command: str, seed: int) -> None:
    compare_orders(vsacli, write_orders(seed, 4 + seed % 6, SHARES.get(command, 0.95)), command)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(8))
def test_another_order_has_the_same_fixes(vsacli: Callable[..., Outcome], seed: int) -> None:
    compare_orders(vsacli, write_orders(seed, QUICK), "check-feasibility", "--fixes")


def compare_alone(vsacli: Callable[..., Outcome], seed: int, joints: int) -> None:
    """Compare each subtree's joints and warnings with those in the report of the whole tree."""
    whole = _report(vsacli, write_orders(seed, joints)[0])
    of_whole = {joint["name"]: joint for joint in whole["joints"]}
    warnings = set[str]()
    for files in write_branches(seed, joints):
        alone = _report(vsacli, files)
        for joint in alone["joints"]:
            of_tree = of_whole[joint["name"]]
            of_tree["energy"].pop("dissipated", None)  # there if any joint of the robot dissipates
            joint["energy"].pop("dissipated", None)
            assert list(differences(of_tree, joint)) == []
        warnings.update(map(_without_line, alone["warnings"]))
    assert warnings == {*map(_without_line, whole["warnings"])}


def _report(vsacli: Callable[..., Outcome], files: TreeFiles) -> dict:
    done = vsacli("check-feasibility", *files, "--json")
    assert done.code in (0, 3), done.err
    return json.loads(done.out)


def _without_line(warning: str) -> str:
    return warning.split(": ", 1)[1] if ".yaml:" in warning else warning


def test_a_branch_on_the_base_gives_what_it_gives_alone(vsacli: Callable[..., Outcome]) -> None:
    compare_alone(vsacli, 1, QUICK)


@pytest.mark.slow
@pytest.mark.parametrize("seed", EVERY_TREE)
def test_branches_on_the_base_of_many_trees_alone(vsacli: Callable[..., Outcome], seed: int) -> None:
    compare_alone(vsacli, seed, 4 + seed % 6)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", [1, 2, 3, 5, 6])
def test_simulations_of_trees_end_on_target(vsacli: Callable[..., Outcome], seed: int) -> None:
    simulate(vsacli, seed, joints=6)


@pytest.mark.slow
def test_a_simulation_of_a_tree_ends_on_target(vsacli: Callable[..., Outcome]) -> None:
    simulate(vsacli, 1, QUICK)


def simulate(vsacli: Callable[..., Outcome], seed: int, joints: int) -> None:
    """Simulate a tree in both orders of its branches."""
    reports = []
    for files in write_orders(seed, joints, share=2):
        done = vsacli("simulate", *files, "-o", files.robot.with_suffix(".h5"), "--json")
        assert done.code == 0, done.err
        reports.append(json.loads(done.out))
        assert reports[-1]["largest_error"]["value"] < 1e-6
    assert list(differences(*reports)) == []


@pytest.mark.slow
@pytest.mark.cases(2)
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("seed", range(5))
def test_generated_code_of_trees_passes_its_own_test(
    vsacli: Callable[..., Outcome], seed: int, precision: str
) -> None:
    files, _ = write_orders(seed, 6, share=2)
    assert vsacli("codegen", files.robot, "-o", "generated", "--precision", precision).code == 0
    sources = sorted(path.name for path in Path("generated").glob("*.c"))
    compile_c(Path("generated"), *STRICT, *sources, "-o", "self_test", "-lm")
    done = subprocess.run(["./self_test"], cwd="generated", capture_output=True, text=True, check=False)
    assert done.stdout == "all values agree\n"


def test_the_one_infeasible_finger_of_five_is_named(vsacli: Callable[..., Outcome]) -> None:
    report = _report(vsacli, write_hand(soft=SOFT))
    assert report["verdict"] == "infeasible"
    assert [joint["name"] for joint in report["joints"] if joint["samples"]["infeasible"]] == [SOFT]


@pytest.mark.slow
def test_the_one_infeasible_finger_of_five_is_fixed_alone(vsacli: Callable[..., Outcome]) -> None:
    done = vsacli("check-feasibility", *write_hand(soft=SOFT), "--fixes", "--json")
    fixes = json.loads(done.out)["fixes"]
    assert [cause["joint"] for cause in fixes["causes"]] == [SOFT]
    offsets = fixes["stiffness_offset"]["offsets"]
    assert offsets.pop(SOFT) > 0
    assert set(offsets.values()) == {0.0}
    assert [*fixes["stiffness_profile"]["changes"]] == [SOFT]
    assert fixes["fixes"][0]["text"].startswith(f"raise the stiffness of {SOFT} by ")
