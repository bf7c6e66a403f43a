"""Results stored in single precision: what is rounded, what is not, and who reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import ROBOT, rest_to_rest
from samples.results import STORED, random_block, write_result

from vsacli import InputError, StorageError, inverse_dynamics, load_robot, load_trajectory, open_result
from vsacli.results.store.reader import StoredResult

HALF_AN_ULP = 2.0**-24
"""Of a number in [1, 2) in single precision, so the largest relative error of rounding to it."""


def test_values_are_rounded_but_times_and_flags_are_not(tmp_path: Path) -> None:
    block = random_block(250, 2)
    path = write_result(tmp_path / "r.h5", block, precision="single")
    with h5py.File(path) as file:
        assert file.attrs["precision"] == "single"
        for name in STORED:
            kind = {"time": np.float64, "flags": np.uint32}.get(name, np.float32)
            np.testing.assert_array_equal(file[name][...], getattr(block, name).astype(kind), strict=True)
    with StoredResult.open(path) as result:
        theta = result.read("theta")
        assert theta.dtype == np.float64
        np.testing.assert_allclose(theta, block.theta, rtol=HALF_AN_ULP, atol=0)
        np.testing.assert_array_equal(result.read("flags"), block.flags, strict=True)


def test_double_precision_is_not_marked(tmp_path: Path) -> None:
    with h5py.File(write_result(tmp_path / "r.h5", random_block(5, 2))) as file:
        assert "precision" not in file.attrs


def test_what_single_precision_does_not_hold_is_refused(tmp_path: Path) -> None:
    block = random_block(20, 2)
    block.stiffness_max[...] = np.inf  # an infinity stays one
    block.dtheta[:, :, 0] = 1e-50  # which becomes zero
    write_result(tmp_path / "kept.h5", block, precision="single")
    block.ddtheta[7, 1, 0] = -3.5e38
    match = (
        r"r\.h5: cannot be written: ddtheta of j1 is -3\.5e\+38 at t = 0\.007 s, beyond the 3\.4e\+38 of "
        "single precision; store in double precision"
    )
    with pytest.raises(StorageError, match=match):
        write_result(tmp_path / "r.h5", block, precision="single")
    assert [path.name for path in tmp_path.iterdir()] == ["kept.h5"]
    with StoredResult.open(tmp_path / "kept.h5") as result:
        assert np.isposinf(result.read("stiffness_max")).all()
        assert not result.read("dtheta")[:, :, 0].any()


def test_an_unknown_precision(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown precision 'singel'; did you mean 'single'"):
        write_result(tmp_path / "r.h5", random_block(5, 2), precision="singel")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_verdicts_near_thresholds_do_not_depend_on_it(tmp_path: Path) -> None:
    """The last step is 2e-9 of the stiffness below the corridor, of which single precision sees nothing."""
    arm = load_robot(ROBOT)
    move = rest_to_rest(tmp_path / "move.yaml", end_stiffness=800 * (1 - 2e-9))
    found = inverse_dynamics(arm, load_trajectory(move, arm))
    read = {}
    for precision in ("double", "single"):
        found.save(tmp_path / f"{precision}.h5", precision=precision)
        with open_result(tmp_path / f"{precision}.h5") as result:
            read[precision] = result.arrays(), result.report
            result.plot()
    (double, judged), (single, again) = read["double"], read["single"]
    assert judged.verdict == "infeasible"
    assert again.as_json() == judged.as_json() == found.report.as_json()
    np.testing.assert_array_equal(single["flags"], double["flags"])
    assert double["stiffness"][-1, 0] < double["stiffness_min"][-1, 0]
    assert single["stiffness"][-1, 0] == single["stiffness_min"][-1, 0]


@pytest.fixture
def stored(vsacli: Any, motion: Path) -> None:
    """`r.h5`."""
    done = vsacli("invdyn", ROBOT, motion, "--store-precision", "single", "-o", "r.h5", "-q")
    assert done.code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("stored")
def test_the_commands_read_it(vsacli: Any) -> None:
    assert "values stored in single precision" in vsacli("info", "r.h5").out.splitlines()
    assert vsacli("plot", "r.h5", "-o", "figures").code == 0
    table = vsacli("export", "r.h5").out.splitlines()
    with StoredResult.open("r.h5") as result:
        assert float(table[-1].split(",")[1]) == result.read("tau_motor")[-1, 0, 0]


@pytest.mark.usefixtures("stored")
def test_computed_again_it_is_equal_after_rounding(vsacli: Any) -> None:
    equal = "r.h5: computed again, equal bit for bit, rounded to single precision"
    done = vsacli("validate", "r.h5", "--recompute", "-q")
    assert (done.code, done.out.splitlines()) == (0, [equal])
    with h5py.File("r.h5", "r+") as file:
        value = file["tau_e"][5, 1]
        file["tau_e"][5, 1] = np.nextafter(value, np.float32(np.inf))
    done = vsacli("validate", "r.h5", "--recompute", "-q")
    assert done.code == 3
    assert done.out.startswith("r.h5: computed again, tau_e differs in 1 values")


def test_the_file_is_half_as_large(tmp_path: Path) -> None:
    block = random_block(20_000, 2)
    single, double = (
        write_result(tmp_path / f"{precision}.h5", block, precision=precision).stat().st_size
        for precision in ("single", "double")
    )
    assert 0.5 < single / double < 0.53  # times and flags are as large as before
