"""What the exit code says."""

from __future__ import annotations

import enum


class Exit(enum.IntEnum):
    """Exit codes; the meaning of each is its line in the documentation."""

    OK = 0
    BUG = 1
    USAGE = 2
    VERDICT = 3
    STORAGE = 4
    INTERRUPTED = 130

    @property
    def meaning(self) -> str:
        """What happened."""
        return _MEANING[self]


_MEANING = {
    Exit.OK: "done; every step feasible, regular and within limits",
    Exit.BUG: "a bug, or a result whose self-check failed (written, and its verdict says so)",
    Exit.USAGE: "usage or input error: one line for each problem; nothing written",
    Exit.VERDICT: "done, but some steps are infeasible, singular or over a limit; the report says which",
    Exit.STORAGE: "a file cannot be read or written (disk full, permission); the target is untouched",
    Exit.INTERRUPTED: "interrupted; the target is untouched",
}

OF_VERDICT = {
    "ok": Exit.OK,
    "over_limit": Exit.VERDICT,
    "singular": Exit.VERDICT,
    "infeasible": Exit.VERDICT,
    "self_check_failed": Exit.BUG,
}
"""Exit code of a run by the verdict of its report."""
