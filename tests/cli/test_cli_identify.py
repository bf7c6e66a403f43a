"""`vsacli identify`: report, exit codes, the robot file that it writes, figures."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.command_line import ROBOT, Outcome
from samples.excited import Excitation, excited
from samples.pages import Page

from vsacli import load_robot

Command = Callable[..., Outcome]

MOTION = Excitation(
    position=[0] * 3, reach=[0.4] * 3, stiffness=[1400] * 3, swing=[300] * 3, duration=12, rate=100
)
SPRINGS = ("--fit", "springs,motors")


@pytest.fixture
def record(own_folder: Path) -> Path:
    """Of an arm with softer springs at the base, and dry friction at the elbow."""
    lab = load_robot(ROBOT).replace(
        {
            "joints.base.actuator.spring.k": 380,
            "joints.elbow.actuator.motor.friction": {"coulomb": 3, "offset": 1},
        }
    )
    return excited(lab, MOTION).noisy(seed=0).write(own_folder / "record.csv", lab)


@pytest.mark.slow
def test_the_file_written_is_that_of_the_robot_found(vsacli: Command, record: Path) -> None:
    found = vsacli(
        "identify", ROBOT, record, "--fit", "springs,motors,friction", "-o", "fitted.yaml", "--json"
    )
    assert found.code == 0
    report = json.loads(found.out)
    assert report["format"] == "vsacli-identification/2"
    assert report["verdict"] == "ok"
    numbers = {number["path"]: number for system in report["systems"] for number in system["numbers"]}
    fitted = load_robot("fitted.yaml")
    base, shoulder, elbow = (joint.actuator for joint in fitted.joints)
    spring = numbers["joints.base.actuator.spring.k"]
    assert spring["changed"]
    assert base.spring[0].k == pytest.approx(
        spring["value"], abs=0.01 * spring["standard_error"]
    )  # two digits
    assert base.spring[0].k == pytest.approx(380, rel=0.01)
    assert shoulder.spring[0].k == pytest.approx(
        400, rel=0.01
    )  # though the file has it as an alias of the base's
    assert elbow.motors[0].friction.coulomb == pytest.approx((3, 3), rel=0.05)
    assert elbow.motors[0].friction.offset == pytest.approx(1, rel=0.05)
    assert shoulder.motors[0].friction is None
    text, before = Path("fitted.yaml").read_text(), ROBOT.read_text()
    assert "k +- " in text
    assert [line for line in text.splitlines() if line.startswith("#")] == [
        line for line in before.splitlines() if line.startswith("#")
    ]
    for comment in ("# the same springs as at the base", "# N m s/rad, between the links"):
        assert comment in text


@pytest.mark.slow
def test_figures_and_report(vsacli: Command, record: Path) -> None:
    found = vsacli("identify", ROBOT, record, *SPRINGS, "--plot", "figures")
    assert [path.name for path in Path("figures").iterdir()] == ["vsa_3r-1-record.png"]
    assert found.code == 3
    assert found.out.startswith("POOR FIT  vsa-3r from 1 recording: ")
    assert "filtered to " in found.out


@pytest.mark.slow
def test_a_page_of_report_and_records(vsacli: Command, record: Path) -> None:
    found = vsacli("identify", ROBOT, record, *SPRINGS, "--plot", "figures", "--format", "html")
    assert found.code == 3
    page = Page(Path("figures/vsa_3r-identification.html"))
    assert re.search(r"vsa-3r from 1 recording: 12 parameters[^\n]*\s*poor fit\s*Report", page.text)
    for line in found.out.splitlines()[1:]:
        for cell in filter(None, map(str.strip, line.split("   "))):
            assert cell in page.text
    [section] = page.data["sections"]
    assert section["heading"] == str(record)
    assert len(section["charts"]) == 2 * 6  # torques, and differences, of six motors
    assert hashlib.sha256(record.read_bytes()).hexdigest() in page.text
    assert hashlib.sha256(ROBOT.read_bytes()).hexdigest() in page.text


def test_a_format_is_that_of_plots(vsacli: Command, record: Path) -> None:
    refused = vsacli("identify", ROBOT, record, "--format", "html")
    assert refused.code == 2
    assert "--format needs --plot" in refused.err


@pytest.mark.slow
def test_what_cannot_be_told_is_exit_code_3(vsacli: Command, own_folder: Path) -> None:
    arm = load_robot(ROBOT)
    record = excited(arm, MOTION._replace(swing=[0] * 3)).noisy(seed=1).write(own_folder / "record.csv", arm)
    found = vsacli("identify", ROBOT, record, *SPRINGS, "-o", "fitted.yaml")
    assert found.code == 3
    assert found.out.startswith("UNIDENTIFIABLE  vsa-3r from 1 recording: ")
    assert "base: only spring.k + 0.0" in found.out
    assert load_robot("fitted.yaml").joints[0].actuator.spring == arm.joints[0].actuator.spring


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("--fit", "sprigns"),
            "'sprigns' is unknown; expected springs, motors, friction, links, .*did you mean 'springs'",
        ),
        (("--fit", "joints.wrist.*"), r"'joints.wrist.\*' is unknown; expected springs"),
        (("--fit", ","), "expected names separated by commas, e.g. springs,motors"),
        (
            ("--bandwidth", "30"),
            r"the bandwidth must be between 1 and 12.5 Hz for .*record.csv \(100 Hz\), not 30",
        ),
        (("--bandwidth", "0"), "0"),
    ],
)
def test_what_is_asked_for_amiss(
    vsacli: Command, record: Path, arguments: tuple[str, ...], words: str
) -> None:
    found = vsacli("identify", ROBOT, record, *arguments, "-o", "fitted.yaml")
    assert found.code == 2
    assert re.search(words, found.err), found.err
    assert not Path("fitted.yaml").exists()


def test_files_that_exist_stay(vsacli: Command, record: Path) -> None:
    Path("fitted.yaml").write_text("mine")
    assert vsacli("identify", ROBOT, record, "-o", "fitted.yaml").code == 4
    assert Path("fitted.yaml").read_text() == "mine"
    assert vsacli("identify", ROBOT, record, "-o", record, "--overwrite").code in (2, 4)
