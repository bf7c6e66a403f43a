"""`vsacli plot`: figures of stored results."""

from __future__ import annotations

import re
import shutil

import pytest
from samples.command_line import ROBOT, contents, installed

NAMES = ("motion", "motor-torque", "elastic-torque", "energy")


@pytest.mark.slow
def test_installed_command_draws_a_result(tmp_path, feasible_result):
    done = installed("plot", feasible_result, "-o", "figures", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.splitlines() == [f"wrote figures/result-{name}.png" for name in NAMES]
    assert contents(tmp_path).keys() == {f"figures/result-{name}.png" for name in NAMES}


@pytest.mark.slow
def test_format(vsacli, tmp_path, infeasible_result):
    assert vsacli("plot", infeasible_result, "--format", "svg").code == 0
    files = contents(tmp_path)
    assert files.keys() == {f"result-{name}.svg" for name in NAMES}
    assert all(content.startswith(b"<?xml") for content in files.values())


@pytest.mark.slow
def test_two_results_are_compared(vsacli, tmp_path, feasible_result, infeasible_result):
    soft = shutil.copy(infeasible_result, tmp_path / "soft.h5")
    done = vsacli("plot", feasible_result, soft, "-o", "both", "--format", "svg")
    assert (done.code, done.err) == (0, "wrote both/result-soft-compare.svg\n")
    assert [path.name for path in (tmp_path / "both").iterdir()] == ["result-soft-compare.svg"]


def test_existing_figures_are_refused_before_anything_is_drawn(vsacli, tmp_path, feasible_result):
    (tmp_path / "result-elastic-torque.png").write_bytes(b"precious")
    done = vsacli("plot", feasible_result)
    assert done.code == 4
    assert done.err.startswith("result-elastic-torque.png: exists already;")
    assert contents(tmp_path) == {"result-elastic-torque.png": b"precious"}


def test_existing_comparison_is_refused_before_the_results_are_read(vsacli, tmp_path, feasible_result):
    (tmp_path / "result-absent-compare.png").write_bytes(b"precious")
    done = vsacli("plot", feasible_result, "absent.h5")
    assert done.code == 4
    assert done.err.startswith("result-absent-compare.png: exists already;")


@pytest.fixture
def torques_alone(vsacli, motion):
    """A result from which one figure can be drawn, `r.h5`."""
    vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--variables", "tau_motor,flags")


@pytest.mark.usefixtures("torques_alone")
def test_figure_without_its_variables_is_left_out_and_named(vsacli, tmp_path):
    done = vsacli("plot", "r.h5")
    assert done.code == 0
    assert re.search(r"^r\.h5: .*elastic-torque.*tau_e", done.err, re.MULTILINE)
    assert {name for name in contents(tmp_path) if name.endswith(".png")} == {"r-motor-torque.png"}


@pytest.mark.usefixtures("torques_alone")
def test_overwrite_replaces_figures_and_verbose_describes_the_result(vsacli, tmp_path):
    (tmp_path / "r-motor-torque.png").write_bytes(b"old")
    done = vsacli("plot", "r.h5", "--overwrite", "--verbose")
    assert (tmp_path / "r-motor-torque.png").read_bytes().startswith(b"\x89PNG")
    assert done.err.startswith("r.h5: vsa-3r, rest-to-rest, 401 samples, ok\n")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"time,q1\n", "is not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "is damaged or truncated"),
    ],
    ids=["empty", "table", "truncated"],
)
@pytest.mark.parametrize("command", ["plot", "export"])
def test_what_is_no_result_is_refused(vsacli, tmp_path, command, content, message):
    (tmp_path / "r.h5").write_bytes(content)
    before = contents(tmp_path)
    done = vsacli(command, "r.h5")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(f"r.h5: {message}")
    assert done.err.count("\n") == 1
    assert contents(tmp_path) == before


def test_a_result_that_is_not_there(vsacli):
    missing = "no such file; expected a result file, as invdyn or simulate writes it"
    assert vsacli("plot", "r.h5").err == f"r.h5: {missing}\n"
    assert vsacli("export", "r.h5").err == "r.h5: no such file\n"


def test_unknown_format_is_a_usage_error(vsacli, feasible_result):
    done = vsacli("plot", feasible_result, "--format", "gif")
    assert done.code == 2
    assert "'gif' is not one of 'png', 'pdf', 'svg'" in done.err


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "nonsense"])
def test_the_backend_of_a_notebook_does_not_matter(tmp_path, feasible_result, backend, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", backend)
    done = installed("plot", feasible_result, "-o", tmp_path, folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert all(line.startswith("wrote ") for line in done.stderr.splitlines())
