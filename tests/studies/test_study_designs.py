"""What varies over a study, and which values its runs have."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import edited
from samples.studies import HEAD, study

from vsacli import InputError
from vsacli.studies.sweeps.study import load_study

ELBOW = "joints.elbow.link.mass"
SPRING = "joints.*.actuator.spring.k"


def values(folder: Path, text: str, path: str) -> list[object]:
    found = load_study(study(folder, text))
    return [found.point(run).values[path] for run in range(found.runs)]


@pytest.mark.parametrize(
    ("way", "expected"),
    [
        ("[1, 2.5, pi]", ["1", "2.5", "pi"]),
        ("{linspace: [1, 2, 5]}", [1, 1.25, 1.5, 1.75, 2]),
        ("{linspace: [2, 1, 1]}", [2]),
        ("{logspace: [1, 100, 3]}", [1, 10, 100]),
    ],
)
def test_values_of_a_grid(tmp_path: Path, way: str, expected: list[object]) -> None:
    assert values(tmp_path, f"vary: {{{ELBOW}: {way}}}", ELBOW) == expected


def test_degrees_become_radians_and_what_is_linked_follows(tmp_path: Path) -> None:
    text = """vary:
  position.end.elbow: {linspace: [0 deg, 90 deg, 3]}
  position.end.shoulder: {linked: position.end.elbow, factor: -0.5}
"""
    found = load_study(study(tmp_path, text))
    assert [each.unit for each in found.dimensions] == ["rad", "rad"]
    np.testing.assert_allclose(
        [list(found.point(run).values.values()) for run in range(3)],
        [[0, 0], [math.pi / 4, -math.pi / 8], [math.pi / 2, -math.pi / 4]],
    )


def test_the_last_entry_varies_fastest(tmp_path: Path) -> None:
    text = f"vary: {{{ELBOW}: [1, 2], duration: [3, 4, 5]}}"
    assert values(tmp_path, text, ELBOW) == ["1"] * 3 + ["2"] * 3
    assert values(tmp_path, text, "duration") == ["3", "4", "5"] * 2


def test_a_hypercube_has_one_point_in_each_layer(tmp_path: Path) -> None:
    """Of each number by itself: a distribution is of each that a path fits, a list of all at once."""
    text = f"""method: latin_hypercube
samples: 40
vary:
  {SPRING}: {{normal: 5 %}}
  {ELBOW}: {{uniform: [2, 6]}}
  duration: [2, 3, 4, 5]
"""
    found = load_study(study(tmp_path, text))
    points = [found.point(run).values for run in range(found.runs)]
    springs = [f"joints.{joint}.actuator.spring.k" for joint in ("base", "shoulder", "elbow")]
    assert list(points[0]) == [*springs, ELBOW, "duration"]
    normal = np.array([[point[path] for path in springs] for point in points])
    layers = np.floor(40 * (0.5 + 0.5 * np.vectorize(math.erf)((normal / 400 - 1) / 0.05 / math.sqrt(2))))
    np.testing.assert_array_equal(np.sort(layers, axis=0), np.tile(np.arange(40.0)[:, None], 3))
    assert abs(np.corrcoef(normal.T)[0, 1]) < 0.5  # they are shuffled: sorted alike it is 1
    masses = np.floor(10 * (np.array([point[ELBOW] for point in points]) - 2))
    np.testing.assert_array_equal(np.sort(masses), np.arange(40))
    assert sorted(point["duration"] for point in points) == [each for each in "2345" for _ in range(10)]


def test_what_is_drawn_about_a_value_of_trajectories_has_one(tmp_path: Path) -> None:
    text = "method: random\nsamples: 2\nvary: {duration: {normal: 5 %}}\n"
    path = study(tmp_path, text, HEAD.replace("move.yaml", "'m*.yaml'"))
    (tmp_path / "more.yaml").write_text((tmp_path / "move.yaml").read_text())
    found = load_study(path)
    assert [found.point(run).values for run in (0, 1)] == [found.point(run).values for run in (2, 3)]
    edited(tmp_path / "move.yaml", tmp_path / "more.yaml", ("duration: 4.0", "duration: 3.0"))
    with pytest.raises(InputError, match=r"study.yaml:7: duration: .*differs between trajectories"):
        load_study(path)


def test_draws_depend_on_the_seed_alone(tmp_path: Path) -> None:
    text = f"method: random\nsamples: 5\nvary: {{{ELBOW}: {{uniform: 10 %}}}}\n"
    first = values(tmp_path, text, ELBOW)
    assert values(tmp_path, text, ELBOW) == first != values(tmp_path, text + "seed: 1\n", ELBOW)
    assert all(0.9 * 5.0894 <= float(str(value)) <= 1.1 * 5.0894 for value in first)
