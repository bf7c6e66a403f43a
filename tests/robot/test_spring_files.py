"""Springs in robot files: what is refused, with file and line, and what of a table reaches the result."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples.command_line import contents

from vsacli import laws, load_robot
from vsacli.actuators.laws.tendons import Mirrored

ROBOT = """\
format: vsacli-robot/1
name: rig
joints:
  - name: swing
    type: revolute
    dh: {a: 0.2, alpha: 0}
    link: {mass: 2, com: [0.1, 0, 0], inertia: {xx: 0.1, yy: 0.2, zz: 0.2}}
    actuator:
      type: antagonistic
      motor: {inertia: 3.2}
      spring: SPRING
"""
LINE = 11
"""Of the spring in `ROBOT`."""

STILL = """\
format: vsacli-trajectory/1
name: still
duration: 1
rate: 100
position: {type: constant, value: 0}
stiffness: {type: constant, value: 120}
"""

TABLE = "{type: table, file: spring.csv}"
DEFLECTIONS = np.linspace(-0.5, 0.5, 11)
TORQUES = 20 * DEFLECTIONS + 300 * DEFLECTIONS**3
ROWS = [f"{phi:.12g},{torque:.12g}" for phi, torque in zip(DEFLECTIONS, TORQUES, strict=True)]


def rows(**changed: str) -> str:
    """The table with rows replaced, named by their number counted from 0, as in row_3."""
    lines = [changed.get(f"row_{number}", row) for number, row in enumerate(ROWS)]
    return "\n".join(["deflection,torque", *lines, ""])


@pytest.fixture
def refusal(vsacli, tmp_path: Path) -> Callable[..., list[str]]:
    """What stderr says to a spring, given as in YAML, with the content of its table."""
    (tmp_path / "still.yaml").write_text(STILL)

    def lines(spring: str, table: str | None = None) -> list[str]:
        (tmp_path / "rig.yaml").write_text(ROBOT.replace("SPRING", spring))
        if table is not None:
            (tmp_path / "spring.csv").write_text(table)
        before = contents(tmp_path)
        done = vsacli("invdyn", "rig.yaml", "still.yaml")
        assert (done.code, done.out) == (2, "")
        assert contents(tmp_path) == before
        found: list[str] = done.err.splitlines()
        return found

    return lines


CONSTANTS = {
    "cubic": ("{type: cubic, k: 0, k_c: 2000}", "k: must be positive, not 0"),
    "polynomial": ("{type: polynomial, c1: -5, c3: 1}", "c1: must be positive, not -5"),
    "negative term": ("{type: polynomial, c1: 5, c3: -1}", "c3: must be zero or positive, not -1"),
    "sinh": ("{type: sinh, k: 1, a: -8}", "a: must be positive, not -8"),
    "exponential": ("{type: exponential, c: 0, a: 7}", "c: must be positive, not 0"),
    "quadratic": ("{type: quadratic, k: -1}", "k: must be positive, not -1"),
    "four_bar": ("{type: four_bar, k: 40, ratio: 1}", "ratio: must be greater than 1, not 1"),
    "limit": ("{type: sinh, k: 1, a: 8, max_deflection: 0}", "max_deflection: must be positive, not 0"),
    "missing": ("{type: sinh, k: 1}", "spring: missing key 'a'"),
    "of another law": ("{type: sinh, k: 1, a: 8, k_c: 2}", "unknown key 'k_c'"),
    "no number": ("{type: quadratic, k: hard}", "k: expected a number in N m/rad^2, found 'hard'"),
    "unknown law": ("{type: shin, k: 1, a: 8}", "spring.type: unknown word 'shin'; did you mean 'sinh'?"),
    "no law": ("{k: 1, a: 8}", "spring: missing key 'type', one of cubic, polynomial, sinh"),
    "no file": ("{type: table}", "spring: missing key 'file'"),
    "file is no text": ("{type: table, file: [a, b]}", "file: expected a text"),
}


@pytest.mark.parametrize(("spring", "message"), CONSTANTS.values(), ids=CONSTANTS)
def test_constants(refusal, spring: str, message: str):
    (line,) = refusal(spring)
    assert line.startswith(f"rig.yaml:{LINE}: ")
    assert message in line


def test_every_problem_of_both_sides_is_told(refusal):
    found = refusal("[{type: cubic, k: 0, k_c: -1}, {type: four_bar, k: 1, ratio: 0.5}]")
    assert len(found) == 3
    assert all(line.startswith(f"rig.yaml:{LINE}: ") for line in found)


@pytest.mark.parametrize(
    "spring", ["{type: polynomial, c1: 5}", "[{type: polynomial, c1: 5}, {type: polynomial, c1: 9}]"]
)
def test_linear_springs_cannot_change_the_stiffness(refusal, spring: str):
    (line,) = refusal(spring)
    assert line.startswith(f"rig.yaml:{LINE}: ")
    assert "both are linear: no motion of the motors changes the stiffness (A is singular everywhere)" in line


@pytest.mark.parametrize(
    "spring", ["{type: quadratic, k: 90}", "[{type: cubic, k: 1, k_c: 1}, {type: exponential, c: 1, a: 7}]"]
)
def test_a_tendon_cannot_be_on_the_other_branch(refusal, spring: str):
    (line,) = refusal(f"{spring}\n      branch: negative")
    assert line.startswith(f"rig.yaml:{LINE + 1}: ")
    assert "branch: must be positive: a spring that only pulls cannot push" in line


TABLES = {
    "torque falls": (rows(row_8="0.3,5"), "10: the torque does not increase from the row before"),
    "deflection falls": (rows(row_4="-0.35,-5"), "6: the deflection does not increase from the row before"),
    "not convex": (
        rows(row_8="0.3,19"),
        "10: the torque 19 lies above 16.8, the line between the rows before and after: it is not convex",
    ),
    "not concave": (
        rows(row_2="-0.3,-19"),
        "4: the torque -19 lies below -16.8, the line between the rows before and after: it is not concave",
    ),
    "too large": (
        rows(row_8="0.3,1e40"),
        "10: the torque must be at most 1e+30 in size, not 1e+40",
    ),
    "too small": (
        rows(row_0="-5e-50,-47"),
        "2: the deflection must be at least 1e-30 in size, not -5e-50",
    ),
    "too few rows": ("\n".join(["deflection,torque", *ROWS[4:8]]), ": expected at least 6 rows, found 4"),
    "no negative side": (
        "\n".join(["deflection,torque", *ROWS[6:], "1,400"]),
        "2: the deflections must go from zero",
    ),
    "no positive side": (
        "\n".join(["deflection,torque", *ROWS[:6], ""]),
        "2: the deflections must go from zero",
    ),
    "header": (
        rows().replace("deflection,torque", "angle,torque"),
        "1: expected the header deflection,torque, found angle,torque",
    ),
    "third column": (
        rows().replace("\n", ",1\n").replace("torque,1", "torque,extra"),
        "1: expected the header deflection,torque",
    ),
    "no header": (
        "\n".join(ROWS),
        "1: expected a header line with column names such as time, base.q, found numbers",
    ),
    "no rows": ("deflection,torque\n", ": has a header but no rows of values"),
    "text": (rows(row_3="-0.2,low"), "5: column 'torque': expected a number, found 'low'"),
    "ragged": (rows(row_3="-0.2"), "5: expected 2 values, one for each column of the header, found 1"),
    "NaN": (rows(row_3="-0.2,nan"), "5: column 'torque': expected a number, found 'nan'"),
}


@pytest.mark.parametrize(("table", "expected"), TABLES.values(), ids=TABLES)
def test_table(refusal, table: str, expected: str):
    (line,) = refusal(TABLE, table)
    place, message = expected.split(": ", 1)
    assert line.startswith(f"spring.csv:{place}: " if place else "spring.csv: ")
    assert message in line


def test_every_row_that_bends_the_wrong_way_is_told(refusal):
    found = refusal(TABLE, rows(row_2="-0.3,-19", row_8="0.3,19"))
    assert [line.split(": ")[0] for line in found] == ["spring.csv:4", "spring.csv:10"]


def test_offset_of_the_torque_is_told(refusal):
    shifted = "\n".join(f"{phi:g},{torque + 4:g}" for phi, torque in zip(DEFLECTIONS, TORQUES, strict=True))
    (line,) = refusal(TABLE, f"deflection,torque\n{shifted}\n")
    assert line == "spring.csv: the torque at zero deflection is 4, expected zero; remove the offset"


def test_problems_of_a_table_that_two_joints_share_are_told_once(vsacli, tmp_path: Path):
    (tmp_path / "spring.csv").write_text(rows(row_8="0.3,5"))
    joint = ROBOT.split("joints:\n")[1].replace("swing", "turn")
    (tmp_path / "rig.yaml").write_text((ROBOT + joint).replace("SPRING", TABLE))
    assert vsacli("check-feasibility", "rig.yaml", "still.yaml").err.count("spring.csv:10:") == 1


def test_missing_table(refusal, tmp_path: Path):
    (tmp_path / "springs.csv").write_text(rows())
    (line,) = refusal(TABLE)
    assert line == "spring.csv: no such file; did you mean 'springs.csv'?"


def test_table_and_yaml_are_reported_together(refusal):
    found = refusal("[{type: table, file: spring.csv}, {type: sinh, k: 0, a: 1}]", rows(row_8="0.3,5"))
    assert [line.split(": ")[0] for line in found] == [f"rig.yaml:{LINE}", "spring.csv:10"]


# Tables that are read


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "still.yaml").write_text(STILL)
    (tmp_path / "spring.csv").write_text(rows())
    (tmp_path / "rig.yaml").write_text(ROBOT.replace("SPRING", TABLE))
    return tmp_path / "rig.yaml"


def test_a_table_is_read(rig: Path):
    first, second = load_robot(rig).joints[0].actuator.laws
    assert isinstance(first, laws.Table)
    assert second is first
    assert first.domain == (-0.5, 0.5)
    # The torques of a polynomial, which the fit can be.
    np.testing.assert_allclose(first.torque(DEFLECTIONS), TORQUES, rtol=0, atol=1e-10)


def test_a_table_from_zero_on_is_a_tendon(rig: Path):
    lines = ["deflection,torque", *(f"{phi:g},{phi + 30 * phi**2:g}" for phi in np.linspace(0, 0.5, 11))]
    (rig.parent / "spring.csv").write_text("\n".join(lines))
    first, second = load_robot(rig).joints[0].actuator.laws
    assert first.pulls_only
    assert isinstance(second, Mirrored)


def test_path_of_a_table_is_relative_to_the_robot(rig: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir("/")
    assert load_robot(rig).joints[0].actuator.spring[0].torque_range[1] == pytest.approx(TORQUES[-1])


def test_table_is_among_the_inputs_of_the_result(vsacli, rig: Path):
    assert vsacli("invdyn", rig, "still.yaml", "-o", "r.h5").code == 0
    assert [Path(source.path).name for source in load_robot(rig).sources] == ["rig.yaml", "spring.csv"]
    content = rows().encode()
    with h5py.File(rig.parent / "r.h5") as result:
        attributes = [dict(group.attrs) for group in result["inputs"].values() if "path" in group.attrs]
    table = next(each for each in attributes if str(each["path"]).endswith("spring.csv"))
    assert hashlib.sha256(content).hexdigest() in map(str, table.values())


ROUGH = f"{DEFLECTIONS[3]:g},{1.001 * TORQUES[3]:.12g}"
"""A row that the curve misses."""


@pytest.mark.slow
def test_misfit_is_a_warning_that_names_the_joint(vsacli, rig: Path):
    (rig.parent / "spring.csv").write_text(rows(row_3=ROUGH))
    rig.write_text(rig.read_text().replace("joints:", "gravity: [0, -9.81, 0]\njoints:"))
    (warning,) = load_robot(rig).warnings
    assert warning.startswith(f"spring of joint swing: the curve through {rig.parent / 'spring.csv'} misses")
    assert "spring of joint swing: the curve through" in vsacli("check-feasibility", rig, "still.yaml").out


def test_misfit_of_either_side_is_told(rig: Path):
    for name in ("spring.csv", "other.csv"):
        (rig.parent / name).write_text(rows(row_3=ROUGH))
    both = "[{type: table, file: spring.csv}, {type: table, file: other.csv}]"
    rig.write_text(ROBOT.replace("SPRING", both).replace("joints:", "gravity: [0, -9.81, 0]\njoints:"))
    assert [Path(warning.split()[7]).name for warning in load_robot(rig).warnings] == [
        "spring.csv",
        "other.csv",
    ]
    assert len(load_robot(rig).sources) == 3


@pytest.mark.slow
def test_shared_table_is_one_source(rig: Path):
    joint = ROBOT.split("joints:\n")[1]
    arm = (ROBOT + joint.replace("swing", "turn")).replace("SPRING", TABLE)
    rig.write_text(arm.replace("joints:", "gravity: [0, -9.81, 0]\njoints:"))
    (rig.parent / "spring.csv").write_text(rows(row_3=ROUGH))
    robot = load_robot(rig)
    assert len(robot.joints) == len(robot.warnings) == len(robot.sources) == 2
