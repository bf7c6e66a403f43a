"""Searches for excitations that end early."""

from __future__ import annotations

import pytest

from vsacli.studies.identification.excitation import fisher, plan


def shorten_searches(patch: pytest.MonkeyPatch, steps: int, records: int = 1) -> None:
    """Let searches try a few members, and predictions draw a few records."""
    for module, name, count in ((plan, "STARTS", 9), (plan, "STEPS", steps), (fisher, "RECORDS", records)):
        patch.setattr(module, name, count)
