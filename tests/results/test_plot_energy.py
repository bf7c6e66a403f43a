"""The figure of a result's energy: elastic energy, and the work of each motor."""

from __future__ import annotations

import numpy as np
import pytest
from samples.figures import Result, rest_to_rest

from vsacli.results.charts.figures import RESULT_DRAWINGS, omitted_figures
from vsacli.results.plots import plot_stored

WORK_1, WORK_2, ELASTIC = "work of motor 1 [J]", "work of motor 2 [J]", "elastic energy [J]"


def with_energy(types: str = "RRR", actuators: list[str] | None = None, **options: object) -> Result:
    """A result whose joint k stores k + 1 J, and whose motors 1 and 2 work t and -t times as much."""
    energy = np.arange(1.0, len(types) + 1)
    result = rest_to_rest(types=types, **options)
    work = result.time[:, None, None] * energy[:, None] * np.array([1.0, -1.0])
    result._values |= {"elastic_energy": np.tile(energy, (len(result.time), 1)), "motor_energy": work}
    kinds = actuators or ["antagonistic"] * len(types)
    work[:, [kind != "antagonistic" for kind in kinds], 1] = np.nan
    return Result(result.time, types, actuators=kinds, **result._values)


def drawn(result: Result) -> dict[str, list[np.ndarray]]:
    """The curves of each panel by the label of its axis."""
    figure = plot_stored(result)["energy"]
    return {axes.get_ylabel(): [line.get_ydata() for line in axes.get_lines()] for axes in figure.axes}


def test_every_joint_has_its_energy_and_every_motor_its_work():
    result = with_energy()
    curves = drawn(result)
    assert list(curves) == [ELASTIC, WORK_1, WORK_2]
    for joint in range(3):
        np.testing.assert_array_equal(curves[ELASTIC][joint], result.read("elastic_energy")[:, joint])
        for label, side in ((WORK_1, 0), (WORK_2, 1)):
            np.testing.assert_array_equal(curves[label][joint], result.read("motor_energy")[:, joint, side])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("actuators", "labels"),
    [
        (["rigid", "elastic", "antagonistic"], {ELASTIC: 3, WORK_1: 3, WORK_2: 1}),
        (["rigid", "elastic", "rigid"], {ELASTIC: 3, WORK_1: 3}),
        (["rigid", "rigid", "rigid"], {WORK_1: 3}),
    ],
)
def test_what_the_actuators_do_not_have_is_not_drawn(actuators: list[str], labels: dict[str, int]):
    curves = drawn(with_energy(actuators=actuators))
    assert {label: len(lines) for label, lines in curves.items()} == labels


def test_infeasible_steps_are_shaded_in_every_panel():
    figure = plot_stored(with_energy(sigma=(850, 790)))["energy"]
    assert all(axes.collections for axes in figure.axes)


def test_a_result_without_the_energies_says_so():
    reason = omitted_figures(RESULT_DRAWINGS, rest_to_rest().variables)["energy"]
    assert reason.startswith("figure energy needs elastic_energy and motor_energy, which this result was")
