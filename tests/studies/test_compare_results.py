"""`vsacli compare` of two results: figures of both against the values in the files, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli import open_result

SLOW = ("--set", "rate=50", "-o")


@pytest.fixture
def results(vsacli: Any) -> tuple[str, str]:
    """A result, and one that is stiffer, faster, and sampled at other times."""
    assert vsacli("invdyn", ROBOT, REST_TO_REST, *SLOW, "soft.h5").code == 0
    changes = ("--set", "stiffness.end=1500", "--set", "duration=1.5")
    vsacli("invdyn", ROBOT, REST_TO_REST, *changes, *SLOW, "stiff.h5")
    return "soft.h5", "stiff.h5"


def test_figures_are_those_of_the_stored_values(vsacli: Any, results: tuple[str, str]) -> None:
    done = vsacli("compare", *results, "--json")
    assert done.code == 0
    compared = json.loads(done.out)
    assert (compared["result"], compared["other"], compared["compared"]) == (*results, 1.5)
    places = {(each["variable"], each["joint"], each["motor"]): each for each in compared["signals"]}
    shoulder = places["tau_motor", "shoulder", 2]
    with open_result("soft.h5") as soft, open_result("stiff.h5") as stiff:
        rows = np.flatnonzero(soft.time <= 1.5)
        own = soft.read("tau_motor")[rows, 1, 1]
        other = np.array(
            [np.interp(t, stiff.time, stiff.read("tau_motor")[:, 1, 1]) for t in soft.time[rows]]
        )
        stiffness = places["stiffness", "base", None]
        assert stiffness["peak"][1] == pytest.approx(stiff.read("stiffness")[:, 0].max(), rel=1e-3)
    assert shoulder["rms"] == pytest.approx([np.sqrt(np.mean(own**2)), np.sqrt(np.mean(other**2))])
    assert shoulder["difference"] == pytest.approx(np.sqrt(np.mean((other - own) ** 2)))
    worst = int(np.abs(other - own).argmax())
    assert (shoulder["worst"], shoulder["worst_time"]) == pytest.approx(
        (other[worst] - own[worst], soft.time[rows][worst])
    )
    assert shoulder["share"] == pytest.approx(shoulder["difference"] / shoulder["rms"][0])


def test_flags_are_counted_in_both(vsacli: Any, results: tuple[str, str]) -> None:
    vsacli("invdyn", ROBOT, REST_TO_REST, "--set", "stiffness.start=780", *SLOW, "low.h5")
    done = vsacli("compare", results[0], "low.h5")
    with open_result("low.h5") as low:
        infeasible = [int(np.count_nonzero(low.read("flags")[:, joint] & 1)) for joint in range(3)]
    for name, count in zip(("base", "shoulder", "elbow"), infeasible, strict=True):
        assert any(line.split() == [name, "infeasible", "0", str(count)] for line in done.out.splitlines())
    assert "to draw both: vsacli plot soft.h5 low.h5" in done.out


def test_equal_results_have_no_difference(vsacli: Any, results: tuple[str, str]) -> None:
    assert vsacli("compare", results[0], results[0]).out.startswith("soft.h5, soft.h5: no difference\n")


def test_what_two_results_do_not_take(vsacli: Any, results: tuple[str, str]) -> None:
    Path("map.yaml").write_text("{}")
    for option in (("--plot", "figures"), ("--time-offset", "1"), ("--columns", "map.yaml")):
        refused = vsacli("compare", *results, *option)
        assert refused.code == 2
        assert f"{option[0]} is for recordings, but stiff.h5 is a result" in refused.err
    assert not Path("figures").exists()
    vsacli("simulate", ROBOT, REST_TO_REST, "--set", "rate=50", "-o", "simulated.h5")
    refused = vsacli("compare", results[0], "simulated.h5")
    assert (refused.code, "compare results with results" in refused.err) == (2, True)


def test_the_help_names_the_figures(vsacli: Any) -> None:
    text = " ".join(vsacli("compare", "--help").out.split())
    assert "Figures of both on the same axes are drawn by `vsacli plot RESULT RESULT`" in text
