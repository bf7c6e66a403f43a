"""One run over a trajectory: its report, and its self-check."""
