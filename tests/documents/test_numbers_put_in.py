"""Numbers put into a YAML file: aliases written out where they must be, errors behind comments."""

from __future__ import annotations

import pytest
import yaml

from vsacli.documents.edited import edited, unaliased, with_errors

ARM = """\
# an arm
joints:
  - spring: &spring {type: cubic, k: 400, k_c: 2e3}   # N m/rad
    motor: &motor
      inertia: 3.2
      damping: 1e-4    # small
  - spring: *spring    # the same
    motor: *motor
  - {spring: *spring, motor: *motor}
"""


def test_what_is_shared_is_written_out_where_a_path_leads() -> None:
    text = unaliased(ARM, ["joints.1.spring.k"])
    assert yaml.safe_load(text) == yaml.safe_load(ARM)
    assert "  - spring: {type: cubic, k: 400, k_c: 2e3}    # the same\n" in text
    assert "{spring: {type: cubic, k: 400, k_c: 2e3}, motor: *motor}" in text
    assert unaliased(ARM, []) == ARM
    assert unaliased(ARM, ["joints.7.spring.k", "name"]) == ARM


def test_an_anchor_is_freed_when_what_it_names_changes() -> None:
    text = edited(unaliased(ARM, ["joints.0.motor.inertia"]), {"joints.0.motor.inertia": 3.25})
    first, second, third = yaml.safe_load(text)["joints"]
    assert first["motor"]["inertia"] == 3.25
    assert second["motor"]["inertia"] == third["motor"]["inertia"] == 3.2
    assert "*motor" not in text
    assert "*spring" in text


def test_numbers_and_mappings_are_put_in() -> None:
    values = {"joints.0.spring.k": 379.79, "joints.0.motor.friction": {"coulomb": 0.5, "offset": -1e-7}}
    first = yaml.safe_load(edited(ARM, values))["joints"][0]
    assert first["spring"]["k"] == 379.79
    assert first["motor"]["friction"] == {
        "coulomb": 0.5,
        "offset": "-1e-07",
    }  # a number to vsacli, if not here


ERRORS = {"joints.0.spring.k": "0.2", "joints.0.spring.k_c": "3", "joints.0.motor.inertia": "0.01"}


def test_errors_stand_behind_comments_and_are_replaced_by_later_ones() -> None:
    text = with_errors(ARM, ERRORS)
    assert "{type: cubic, k: 400, k_c: 2e3}   # N m/rad; k +- 0.2, k_c +- 3\n" in text
    assert "      inertia: 3.2  # inertia +- 0.01\n" in text
    assert yaml.safe_load(text) == yaml.safe_load(ARM)
    assert with_errors(text, ERRORS) == text
    later = with_errors(text, {"joints.0.motor.inertia": "0.02", "joints.0.spring.k": "0.1"})
    assert "inertia: 3.2  # inertia +- 0.02\n" in later
    assert "# N m/rad; k +- 0.1\n" in later


@pytest.mark.parametrize("path", ["joints.0.motor.width", "joints.9.motor.inertia", "name"])
def test_errors_of_what_is_not_there_do_not_count(path: str) -> None:
    assert with_errors(ARM, {path: "1"}) == ARM
