"""Why there is no suggestion of a kind."""

from __future__ import annotations

from vsacli.base.errors import VsacliError


class ImpossibleError(VsacliError):
    """No change of a kind mends a task; the message says why, without a full stop."""
