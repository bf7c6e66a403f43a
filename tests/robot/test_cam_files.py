"""Preloaded cams in robot files: what is refused, with file and line; how profiles are fitted and kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples.command_line import contents
from samples.mechanisms import profile

from vsacli import load_robot, mechanisms

ROBOT = """\
format: vsacli-robot/1
name: rig
joints:
  - name: swing
    type: revolute
    dh: {a: 0.2, alpha: 0}
    link: {mass: 2, com: [0.1, 0, 0], inertia: {xx: 0.1, yy: 0.2, zz: 0.2}}
    actuator:
      type: serial
      motor: {inertia: 3.2}
      mechanism: MECHANISM
"""
LINE = 11
"""Of the mechanism in `ROBOT`."""

STILL = """\
format: vsacli-trajectory/1
name: still
duration: 1
rate: 100
position: {type: constant, value: 0}
stiffness: {type: constant, value: 20}
"""

CAM = "{type: cam, profile: designs/cam.csv, k: 40000, r: 0.005, pretension: [0.002, 0.025]}"
DEFLECTIONS = np.linspace(-0.5, 0.5, 21)
ROWS = [f"{phi:.12g},{0.01 + 0.03 * phi**2:.12g}" for phi in DEFLECTIONS]


def rows(**changed: str) -> str:
    """The table with rows replaced, named by their number counted from 0, as in row_3."""
    lines = [changed.get(f"row_{number}", row) for number, row in enumerate(ROWS)]
    return "\n".join(["deflection,lift", *lines, ""])


@pytest.fixture
def rig(tmp_path: Path) -> Callable[..., None]:
    """Writes `rig.yaml`, `still.yaml`, and the profile in a folder beside them."""

    def write(mechanism: str = CAM, table: str = rows()) -> None:
        (tmp_path / "still.yaml").write_text(STILL)
        (tmp_path / "rig.yaml").write_text(ROBOT.replace("MECHANISM", mechanism))
        (tmp_path / "designs").mkdir()
        (tmp_path / "designs" / "cam.csv").write_text(table)

    return write


CONSTANTS = {
    "levers alike": (
        "{type: maccepa, b: 0.1, c: 0.1, k: 400, r: 0.01, pretension: [0, 0.02]}",
        "c: must differ from b: equal levers have a kink at rest",
    ),
    "pretension below zero": (
        "{type: maccepa, b: 0.1, c: 0.2, k: 400, r: 0.01, pretension: 0.02}",
        "pretension: must have two ends, the smaller one first, zero or above",
    ),
    "no range": (
        "{type: maccepa, b: 0.1, c: 0.2, k: 400, r: 0.01, pretension: [0.01, 0.01]}",
        "pretension: must have two ends, the smaller one first, zero or above",
    ),
    "no drum": (
        "{type: maccepa, b: 0.1, c: 0.2, k: 400, r: 0, pretension: [0, 1]}",
        "r: must be finite and not",
    ),
    "no profile": ("{type: cam, k: 400, r: 0.01, pretension: [0, 1]}", "mechanism: missing key 'profile'"),
}


@pytest.mark.parametrize(("mechanism", "message"), CONSTANTS.values(), ids=CONSTANTS)
def test_constants(rig: Callable[..., None], vsacli, mechanism: str, message: str):
    rig(mechanism)
    done = vsacli("invdyn", "rig.yaml", "still.yaml")
    (line,) = done.err.splitlines()
    assert (done.code, done.out) == (2, "")
    assert line.startswith(f"rig.yaml:{LINE}: ")
    assert message in line


PROFILES = {
    "two minima": (
        rows(row_17="0.35,0.0110"),
        "19: the lift 0.011 lies below that of a row nearer to the minimum at 0: a cam needs one minimum",
    ),
    "minimum at the end": (
        "\n".join(rows().splitlines()[:12]) + "\n",
        "12: the lift is lowest at an end; a cam needs",
    ),
    "deflection falls": (
        rows(row_4="-0.45,0.015"),
        "6: the deflection does not increase from the row before",
    ),
    "too large": (rows(row_8="-0.1,1e40"), "10: the lift must be at most 1e+30 in size, not 1e+40"),
    "too few": ("deflection,lift\n-1,1\n0,0\n1,1\n", "expected at least 6 rows, found 3"),
    "kink": (
        "deflection,lift\n" + "\n".join(f"{phi:.12g},{0.03 * abs(phi):.12g}" for phi in DEFLECTIONS) + "\n",
        ": a smooth profile misses the lift 0.0045 by 6.5 % of its range, more than 3 %: there is a kink",
    ),
    "another quantity": (rows().replace("lift", "torque"), "1: expected the header deflection,lift, found"),
}


@pytest.mark.parametrize(("table", "message"), PROFILES.values(), ids=PROFILES)
def test_profiles(rig: Callable[..., None], vsacli, tmp_path: Path, table: str, message: str):
    rig(table=table)
    before = contents(tmp_path)
    done = vsacli("invdyn", "rig.yaml", "still.yaml")
    (line,) = done.err.splitlines()
    assert (done.code, done.out) == (2, "")
    assert contents(tmp_path) == before
    assert line.startswith("designs/cam.csv:")
    assert message in line


@pytest.mark.slow
def test_the_profile_is_among_the_inputs_and_its_misfit_is_told(
    rig: Callable[..., None], vsacli, tmp_path: Path
):
    table = rows(row_17="0.35,0.0137")
    rig(table=table)
    done = vsacli("invdyn", "rig.yaml", "still.yaml", "-o", "still.h5")
    assert done.code == 0
    assert "the curve through designs/cam.csv misses a measured lift by up to" in done.out
    with h5py.File(tmp_path / "still.h5") as result:
        attributes = [dict(group.attrs) for group in result["inputs"].values() if "path" in group.attrs]
    kept = next(each for each in attributes if str(each["path"]).endswith("cam.csv"))
    assert hashlib.sha256(table.encode()).hexdigest() in map(str, kept.values())


def test_misfits_are_told_unless_they_are_rounding_and_with_their_place_if_they_matter():
    assert cam(DEFLECTIONS, 0.01 + 0.03 * DEFLECTIONS**2).warnings == ()
    lift = 0.01 + 0.03 * DEFLECTIONS**2
    lift[16] += 2e-4  # 2.7 % of the range of 0.0075, of which the curve follows a part
    (warning,) = cam(DEFLECTIONS, lift).warnings
    assert "% of its range), at the deflection 0.25: near a kink or an outlier" in warning


def cam(phi: np.ndarray, lift: np.ndarray) -> mechanisms.Cam:
    return mechanisms.Cam(k=1, r=1, pretension=(0, 1), profile=profile(phi, lift))


def test_a_symmetric_profile_rests_at_zero_and_is_symmetric():
    phi = np.linspace(-0.5, 0.5, 41)
    fitted = cam(phi, np.round(0.03 * phi**2 + 0.2 * np.cosh(2 * phi), 6))
    assert fitted.rest == 0
    at = np.linspace(0, 0.5, 100)
    for even, odd in zip(fitted.lift(at), fitted.lift(-at).mirrored(), strict=True):
        np.testing.assert_allclose(even, odd, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("digits", [6, 7, 9])
def test_a_profile_written_with_few_digits_is_smooth(digits: int):
    """Up to the curvature, errors are those of the digits over the distance of the points."""
    phi = np.linspace(-0.6, 0.7, 101)
    fitted = cam(phi, np.round(0.02 * (np.cosh(3 * (phi - 0.0321)) - 1), digits) + 0.005)
    assert fitted.rest == pytest.approx(0.0321, abs=10.0**-digits * 100)
    at = np.linspace(-0.6, 0.6, 200)
    lift = fitted.lift(at)
    exact = 0.02 * (np.cosh(3 * at) - 1), 0.06 * np.sinh(3 * at), 0.18 * np.cosh(3 * at)
    for found, expected, share in zip(lift, exact, (30, 300, 10_000), strict=False):
        np.testing.assert_allclose(found, expected, rtol=0, atol=10.0**-digits * share)


@pytest.mark.parametrize("seed", range(5))
def test_whatever_the_noise_is_there_is_one_minimum_and_four_derivatives(seed: int):
    rng = np.random.default_rng(seed)
    phi = np.unique(rng.uniform(-0.5, 0.6, 60))
    lift = 0.02 * (phi - 0.05) ** 2 + 0.05 * (phi - 0.05) ** 4
    fitted = cam(phi, lift + 5e-6 * rng.normal(size=len(phi)))
    low, high = (end - fitted.rest for end in fitted.deflection_range)
    at = np.linspace(low, high, 20_001)
    found = fitted.lift(at)
    assert np.all(np.sign(found.l1) == np.sign(at))
    step = at[1] - at[0]
    for below, above in pairwise(found[:4]):
        # the trapezoidal rule errs by the cube of the step
        rise, bound = step * (above[1:] + above[:-1]) / 2, 1e-6 * step * np.abs(above).max()
        np.testing.assert_allclose(np.diff(below), rise, rtol=0, atol=bound)
    # the fourth has kinks, but no jumps
    assert np.abs(np.diff(found.l4)).max() < 0.01 * np.abs(found.l4).max()


def test_the_path_of_a_profile_is_relative_to_the_robot(
    rig: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    rig()
    monkeypatch.chdir("/")
    (source,) = load_robot(tmp_path / "rig.yaml").joints[0].actuator.sources
    assert source.path == str(tmp_path / "designs" / "cam.csv")
