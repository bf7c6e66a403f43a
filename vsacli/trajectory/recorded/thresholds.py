"""Thresholds of the faults of recordings: one table, with reasons.

"Clean records" are those of `tests/samples/clean_records.py`: sines, rest to rest with pauses, sweeps and
velocity steps, with the noise of encoders, white or filtered. None of 640 gives a warning.
"""

from __future__ import annotations

GAP_STEPS = 5.0
"""Length of a step, in median steps, that is a gap. Over a row or two that a bus lost no spline guesses."""

LONGEST_STEP = 0.5
"""Median step, s, beyond which stamps are hardly seconds: no robot is recorded at 2 Hz."""

SHORTEST_STEP = 2e-6
"""Median step, s, below which they are hardly seconds either: no joint is recorded at 500 kHz."""

ENOUGH_ROWS = 50
"""Rows below which steps of seconds may have been written by hand."""

JITTER_SHARE = 0.05
"""Median change from step to step, in steps, that is jitter, beyond what digits that were cut off explain."""

BLOCK = 64
"""Samples over which noise is estimated by a median, which a fault of 20 of them does not change much."""

NOISE_DEVIATIONS = 8.0
"""Standard deviations of the noise near it by which a sample is off, or a jump is large. Of 1e7 samples with
white noise 1e-8 are; the estimate by medians of 64 may be a third too small."""

QUANTA = 4.0
"""The same for steps of an encoder: rounding moves a sample by half a step, its prediction by one at most."""

FIT_DEVIATIONS = 8.0
"""Deviations of its neighbours from a polynomial through them by which an outlier is off. A kink, a jump or
a fast motion, which no polynomial follows, reaches 2."""

MARGIN = 6
"""Samples on either side of an outlier that a polynomial of degree `POLYNOMIAL` is put through."""

POLYNOMIAL = 4

MOST_TOGETHER = 3
"""Samples off together that are still outliers, not a part of the motion."""

MOST_EVENTS = 500
"""Outliers looked at in a column; a millisecond each at most."""

LEAST_SHARE = 0.5
"""Smallest share of outliers among the events at least a third as large.

When a joint creeps, each step of its encoder, filtered, is an event; one in fifty happens to look like an
outlier.
"""

END_SAMPLES = 32
"""Samples at an end whose predictions from the ten further inside tell how well the first one's should be."""

END_SHARE = 5.0
"""Error of the prediction of the first sample, in the largest of those, that makes it an outlier."""

FROZEN_STEPS = 3
"""Steps without any change after which a sensor is frozen, if it then jumps to where the motion has got."""

FROZEN_AT_END_STEPS = 10
"""The same at the ends of a record, where no jump tells, but a motion that stops within one step."""

SPEED_SAMPLES = 4
"""Steps over which the speed before and after is taken."""

JUMP_SHARE = (0.4, 2.5)
"""Range of a jump after a frozen stretch, as a share of the path that the speeds before and after it make."""

ABRUPT_SHARE = 0.7
"""Last step before a stop, in mean steps before it, that is no braking: a smooth motion has 0.2 or less."""

HELD_ROWS = 20
"""Rows at most over which a logger that is faster than its sensor repeats each value."""

HELD_SHARE = 0.9
"""Share of the changes that must come after just this many rows.

Those of an encoder at a steady speed do, but they are single steps of it.
"""

HELD_CHANGES = 50
"""Changes below which the rows between them may agree by chance."""

SATURATED_STEPS = 3
"""Steps at the very largest or smallest value, entered and left as if the motion went on."""

WRAP_TOLERANCE = 0.5
"""Largest distance from 2 pi, rad, of the jump of a wrapped angle; its neighbours must be smaller than
this."""

LARGEST_ANGLE = 6.6
"""Positions, rad, beyond which an angle is more likely in degrees: somewhat more than one turn either way."""

LARGEST_TRAVEL = 10.0
"""Positions of a prismatic joint, m, beyond which they are more likely in millimetres."""
