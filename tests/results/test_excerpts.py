"""Some joints of a result over a stretch of time."""

from __future__ import annotations

import numpy as np
import pytest
from samples.figures import rest_to_rest

from vsacli import InputError
from vsacli.results.plots import plot_stored
from vsacli.results.store.excerpt import Excerpt


def excerpt(*arguments: object) -> Excerpt:
    """Of 401 steps over 4 s of base, shoulder and elbow."""
    return Excerpt(rest_to_rest(401), *arguments)


def test_an_excerpt_has_the_steps_of_its_stretch_both_ends_included() -> None:
    whole, part = rest_to_rest(401), excerpt((), (1.0, 1.5))
    assert (part.samples, part.time[0], part.time[-1]) == (51, 1.0, 1.5)
    np.testing.assert_array_equal(part.read("tau_motor"), whole.read("tau_motor")[100:151])
    np.testing.assert_array_equal(part.read("q", 10, 20), whole.read("q")[110:120])
    np.testing.assert_array_equal(part.read("q", 40, 200), whole.read("q")[140:151])


def test_joints_keep_their_order_and_what_belongs_to_them() -> None:
    whole = rest_to_rest(401)
    whole.bounds["q"] = np.arange(6.0).reshape(3, 1, 2)
    part = Excerpt(whole, ("elbow", "base"))
    assert part.joint_names == ("base", "elbow")
    assert part.existing(part.declared["tau_motor"]).shape == (2, 2)
    np.testing.assert_array_equal(part.limits("q")[:, 0], [[0, 1], [4, 5]])
    np.testing.assert_array_equal(part.read("tau_motor"), whole.read("tau_motor")[:, [0, 2]])


def test_a_single_step_may_be_all() -> None:
    part = excerpt((), (2.0, 2.0))
    assert part.samples == 1
    assert set(plot_stored(part)) == {"motion", "motor-torque", "elastic-torque"}


@pytest.mark.parametrize(
    ("span", "words"),
    [
        ((5.0, 6.0), "from t = 5 to 6 s"),
        ((-np.inf, -1.0), "up to t = -1 s"),
        ((4.5, np.inf), "from t = 4.5 s on"),
        ((1.0001, 1.0002), "from t = 1.0001 to 1.0002 s"),
        ((np.nan, np.inf), "from t = nan s on"),
    ],
)
def test_a_stretch_without_steps_is_refused(span: tuple[float, float], words: str) -> None:
    expected = f"run.h5: has no samples {words}; it spans 0 to 4 s (--from, --to)"
    with pytest.raises(InputError) as caught:
        excerpt((), span)
    assert str(caught.value) == expected


def test_unknown_joints_are_named_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"run.h5: has no joint 'ellbow'; did you mean 'elbow'\?"):
        excerpt(("ellbow",))


def test_an_excerpt_that_ends_early_is_not_a_run_that_did() -> None:
    whole = rest_to_rest(401)
    whole.complete = False
    assert Excerpt(whole, (), (0.0, 1.0)).complete
    assert not Excerpt(whole, (), (1.0, np.inf)).complete
