"""Thresholds of the faults of recordings, with reasons.

None of 640 clean recordings of `tests/samples/clean_records.py` gives a warning: sines, rest-to-rest motions
with pauses, sweeps and velocity steps, with noise of encoders, white or filtered.
"""

from __future__ import annotations

GAP_STEPS = 5.0
"""Smallest gap, in median intervals. Splines are reliable over a row or two that a bus lost."""

LONGEST_STEP = 0.5
"""Longest median interval, s, of stamps in seconds: no robot is recorded at 2 Hz."""

SHORTEST_STEP = 2e-6
"""Shortest median interval, s, of stamps in seconds: no joint is recorded at 500 kHz."""

ENOUGH_ROWS = 50
"""Fewest rows of a recording; fewer, at intervals of seconds, may have been written by hand."""

JITTER_SHARE = 0.05
"""Median change of successive intervals, in intervals, that is jitter, beyond that due to resolution."""

BLOCK = 64
"""Samples over which noise is estimated by a median, which 20 faulty ones change little."""

NOISE_DEVIATIONS = 8.0
"""Number of standard deviations of the noise nearby by which a sample is off, or a jump is large. Of 1e7
samples with white noise 1e-8 are; the estimate by medians of 64 may be a third too small."""

QUANTA = 4.0
"""The same in steps of an encoder: rounding moves a sample by half a step, its prediction by one at most."""

FIT_DEVIATIONS = 8.0
"""Smallest error of an outlier, in root mean square errors of the polynomial through its neighbors. A kink, a
jump or a fast motion, which no polynomial follows, reaches 2."""

MARGIN = 6
"""Number of samples on either side of an outlier to which a polynomial of degree `POLYNOMIAL` is fitted."""

POLYNOMIAL = 4

MOST_TOGETHER = 3
"""Most adjacent outliers; more are a part of the motion."""

MOST_EVENTS = 500
"""Most events checked in a column; each takes a millisecond at most."""

LEAST_SHARE = 0.5
"""Smallest share of outliers among events at least a third as large.

When a joint creeps, each filtered step of its encoder is an event; one in fifty happens to look like an
outlier.
"""

END_SAMPLES = 32
"""Samples at an end whose prediction errors, from the ten next samples, are compared with the first's."""

END_SHARE = 5.0
"""Smallest prediction error of the first sample, over the largest of those, that makes it an outlier."""

DIFFERENCED = 0.02
"""Largest distance of an outlier of a derivative from a difference of samples, over its error, if it is one.
Printed digits change it by less; that of a false value is 1."""

FROZEN_STEPS = 3
"""Fewest intervals without change of a frozen sensor, if it then jumps to the present position."""

FROZEN_AT_END_STEPS = 10
"""The same at the ends of a recording, where a motion that stops within one interval shows it."""

SPEED_SAMPLES = 4
"""Number of intervals over which the speeds before and after are computed."""

JUMP_SHARE = (0.4, 2.5)
"""Range of a jump after a frozen stretch, as a share of the distance by the speeds before and after it."""

ABRUPT_SHARE = 0.7
"""Smallest last change before an abrupt stop, in mean changes before it; a smooth motion has 0.2 or less."""

HELD_ROWS = 20
"""Most rows in which a logger that is faster than its sensor repeats each value."""

HELD_SHARE = 0.9
"""Smallest share of changes after this number of rows.

Changes of an encoder at a steady speed fulfill this, too, but are single steps of it.
"""

HELD_CHANGES = 50
"""Fewest changes; with fewer, the numbers of rows between them may agree by chance."""

SATURATED_STEPS = 3
"""Fewest intervals at the largest or smallest value, entered and left as if the motion went on."""

WRAP_TOLERANCE = 0.5
"""Largest distance from 2 pi, rad, of the jump of a wrapped angle, and of changes next to it from zero."""

LARGEST_ANGLE = 6.6
"""Position, rad, beyond which an angle is probably in degrees: somewhat more than one turn either way."""

LARGEST_TRAVEL = 10.0
"""Position of a prismatic joint, m, beyond which it is probably in millimeters."""
