"""`optimize:` in a study: each run's optimum is that of `vsacli optimize`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.studies import HEAD, column, content, study

from vsacli import inverse_dynamics, load_robot, load_trajectory, optimize
from vsacli.cli.optimize import optimize as command
from vsacli.studies.search.criteria import CRITERIA
from vsacli.studies.sweeps.study import load_study
from vsacli.studies.sweeps.study_file import MINIMIZED, VARIED

ONE_JOINT = HEAD.replace("arm.yaml", "tendon.yaml").replace("move.yaml", "pull.yaml")
"""The arm with one joint, which takes less time."""

SPRINGS = (
    "vary: {rate: [10, 12]}\noptimize: {minimize: peak, min_margin: 3%, seed: 2}\nkeep: [energy_spent]\n"
)


def one_joint(folder: Path, text: str) -> str:
    (folder / "tendon.yaml").write_text((REPOSITORY / "robots" / "tendon_1r.yaml").read_text())
    (folder / "pull.yaml").write_text((REPOSITORY / "trajectories" / "tendon_1r.yaml").read_text())
    return str(study(folder, text, ONE_JOINT))


def test_words_are_those_of_the_command() -> None:
    words: dict[str | None, Any] = {each.name: each.type for each in command.params}
    assert (tuple(words["minimize"].choices), tuple(words["vary"].choices)) == (MINIMIZED, VARIED)
    assert {*MINIMIZED} == {*CRITERIA, "time"}


@pytest.mark.parametrize("share", ["10 %", "10%", "0.1", "'10 %'", "1e1 %"])
def test_a_margin_in_percent_is_a_hundredth(share: str, tmp_path: Path) -> None:
    optimized = load_study(one_joint(tmp_path, f"optimize: {{min_margin: {share}}}\n")).file.optimize
    assert optimized is not None
    assert optimized.min_margin == 0.1


@pytest.mark.slow
def test_a_row_has_the_optimum_of_its_run(vsacli: Any, own_folder: Path) -> None:
    """Costs, verdict and what is kept, bit for bit; in two processes and in parts, too."""
    path = one_joint(own_folder, SPRINGS)
    assert vsacli("study", path, "-q", "--processes", "2").code == 0
    robot = load_robot("tendon.yaml")
    found = optimize(
        robot, load_trajectory("pull.yaml", robot, {"rate": 12}), "peak", min_margin=0.03, seed=2
    )
    [joint] = found.joints.values()
    assert found.trajectory is not None
    report = inverse_dynamics(robot, found.trajectory).report
    assert column("study.h5", "cost_before")[1].tolist() == [joint.before]
    assert column("study.h5", "cost_after")[1].tolist() == [joint.after]
    assert column("study.h5", "energy_spent")[1].tolist() == [report.joints[0].energy.spent]
    assert column("study.h5", "verdict")[1] == report.verdict
    assert joint.after < joint.before
    for part in (1, 2):
        assert vsacli("study", path, "--shard", f"{part}/2", "-q").code == 0
    assert vsacli("study", "--merge", "study-1-of-2.h5", "study-2-of-2.h5", "-o", "all.h5", "-q").code == 0
    assert content("study.h5") == content("all.h5")


@pytest.mark.slow
def test_durations_before_and_after(vsacli: Any, own_folder: Path) -> None:
    """Of a timing there is one for the robot; a torque that cannot hold the load makes it impossible."""
    text = "vary: {'joints.*.actuator.motor.max_torque': [30, 1]}\noptimize: {minimize: time}\n"
    done = vsacli("study", one_joint(own_folder, text.replace("vary: {", "vary: {rate: [200], ")))
    assert done.code == 0, done.err
    assert column("study.h5", "verdict").tolist() == ["ok", "impossible"]
    assert "1 ok, 1 impossible\n" in done.out
    assert "nothing feasible was found in 1 run; the column error of the table says why" in done.out
    assert column("study.h5", "error")[1]
    before, after = column("study.h5", "cost_before"), column("study.h5", "cost_after")
    duration = load_trajectory("pull.yaml", load_robot("tendon.yaml")).duration
    assert (before.shape, before[0]) == ((2,), duration)
    assert after[0] < before[0]
    assert np.isnan([before[1], after[1], *column("study.h5", "margin")[1]]).all()
    assert vsacli("plot", "study.h5").code == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("optimize: {minimize: torqe}", "minimize: unknown word 'torqe'; did you mean 'torque'?"),
        ("optimize: {min_margin: 300 %}", "min_margin: must be above 0 and below 1"),
        ("optimize: {min_margin: 3 N m}", "min_margin: '3 N m' has a unit; write the number alone"),
        ("optimize: {minimize: time, vary: stiffness}", "it is `timing` or `both` that varies"),
        ("optimize: torque", "optimize: expected a mapping"),
    ],
)  # fmt: skip
def test_what_cannot_be_optimized(vsacli: Any, own_folder: Path, text: str, message: str) -> None:
    done = vsacli("study", str(study(own_folder, text)))
    assert (done.code, message in done.err) == (2, True), done.err


@pytest.mark.slow
def test_what_cannot_be_minimized_of_a_robot_is_a_row_that_says_so(vsacli: Any, own_folder: Path) -> None:
    done = vsacli("study", str(study(own_folder, "optimize: {minimize: copper_loss}\n")))
    assert (done.code, column("study.h5", "verdict").tolist()) == (3, ["failed"])
    assert "torque_constant" in done.out
