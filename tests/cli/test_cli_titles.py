"""Titles of figures, which say what they show."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from samples.command_line import ROBOT, rest_to_rest

from vsacli.cli.main import run

Titles = Callable[[], dict[str, str]]


@pytest.fixture
def titles(own_folder: Path, drawn_figures: dict[str, Figure]) -> Titles:
    """Return the titles of the figures that commands save, by name; the motion is coarse.yaml."""
    rest_to_rest(own_folder / "coarse.yaml")
    return lambda: {name: figure.get_suptitle() for name, figure in drawn_figures.items()}


def done(*words: object) -> None:
    assert run([*map(str, words), "-q"]) == 0


@pytest.mark.slow
def test_an_optimum_has_its_objective(titles: Titles) -> None:
    done("optimize", ROBOT, "coarse.yaml", "--set", "rate=10", "--plot", ".")
    assert titles() == {"optimum": "optimum of vsa-3r, rest-to-rest: rms motor torque, before and after"}


def test_a_sensitivity_has_its_tolerances(titles: Titles) -> None:
    done("sensitivity", ROBOT, "coarse.yaml", "--tolerances", "5%", "--plot", ".")
    assert titles() == {
        "ranking": "sensitivity of vsa-3r, rest-to-rest: 15 of 72 parameters",
        "band": "sensitivity of vsa-3r, rest-to-rest: 72 parameters, tolerances 5%",
    }


def test_a_sizing_is_one_of_motors(titles: Titles) -> None:
    done("size", ROBOT, "coarse.yaml", "--plot", ".")
    assert titles() == {"torque-speed": "sizing of motors: vsa-3r, rest-to-rest (4 s)"}


def test_a_comparison_has_recording_and_result(titles: Titles) -> None:
    done("invdyn", ROBOT, "coarse.yaml", "-o", "result.h5")
    done("export", "result.h5", "--variables", "q,tau_motor", "-o", "log.csv")
    done("compare", "result.h5", "log.csv", "--plot", ".")
    title = "comparison of recording log with result"
    assert titles() == {name: f"{title}: {name}" for name in ("q", "tau_motor")}


@pytest.mark.slow
def test_an_identification_is_a_fit_to_its_recording(titles: Titles) -> None:
    done("simulate", ROBOT, "coarse.yaml", "--sensor-noise", "2e-4,0.5", "-o", "moved.h5")
    done("export", "moved.h5", "--variables", "q_measured,theta_measured,tau_motor_measured", "-o", "log.csv")
    run([*map(str, ("identify", ROBOT, "log.csv", "--fit", "springs", "--plot", ".", "-q"))])
    assert titles() == {"1-log": "identification of vsa-3r: fit to log, filtered"}
