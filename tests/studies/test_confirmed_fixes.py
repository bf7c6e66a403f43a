"""Fixes are confirmed by runs: each once, and those that fell short again after another search."""

from __future__ import annotations

import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli import fixes, load_robot, load_trajectory
from vsacli.studies.search import fix_search


def test_every_fix_is_confirmed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In 0.2 s, profiles of the 3R fall short between the samples several times."""
    confirmed, short = [], []
    verify_fixes = fix_search.verify_fixes

    def noted(acceptance, candidates):
        for fix, refused in verify_fixes(acceptance, candidates):
            (confirmed if refused is None else short).append(fix)
            yield fix, refused

    robot = load_robot(ROBOT)
    motion = load_trajectory(REST_TO_REST, robot, {"duration": 0.2})
    monkeypatch.setattr(fix_search, "verify_fixes", noted)
    chosen = fixes(robot, motion).fixes
    assert len(short) > 1
    assert {id(each) for each in chosen} == {id(each) for each in confirmed}
    assert len(confirmed) == len(chosen)
