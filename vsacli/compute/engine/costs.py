"""Times of the backends, from which "auto" chooses: constants, so that repeated runs choose the same.

`python tests/benchmarks/engine_costs.py` measures them on the bundled robots, whose programs have 200 to
6,000 operations, with gcc 12 and AVX-512: medians of processor time, all in one thread. They are not
adjusted to the machine, since a choice by measured time would let results of repeated runs differ in the
last digits.
"""

from __future__ import annotations

TRACED_SECONDS = 0.3e-9
"""Time of NumPy for one operation of a traced program on one sample, s: 0.22 to 0.4 ns."""

UNTRACED_SECONDS = 0.5e-9
"""The same where a kernel with loops or branches runs as it is written, s: 0.4 to 0.7 ns, and up to 2 ns
where a loop goes on for few samples that are far apart in memory."""

COMPILED_SECONDS = 0.08e-9
"""Time of compiled code for one operation on one sample in one thread, s: 0.05 to 0.2 ns."""

USUAL_ITERATIONS = 5
"""Usual number of iterations of a loop: 2 to 10, and 22 for the continuation of a potential."""

BRANCH_SHARE = 0.05
"""Usual share of samples, or passes over them, that enter a branch. Most branches are the fallback of an
iteration: with measured springs, whose branches have six times the operations around them, they take a
tenth of the time."""

NUMPY_CALL_SAMPLES = 3_000
"""Overhead of a NumPy call, 0.9 us, as a number of samples; it matters in the short blocks of long chains."""

TRACE_FROM = 100_000
"""Number of samples from which on a traced program saves NumPy more time than tracing takes: 83,000 to
158,000 for robots of one to seven joints, 47,000 with 50, and 23,000 with 1000, that is 1,200 in their short
blocks."""

LOOK_FROM = TRACE_FROM
"""Number of samples, in blocks of the usual size, from which on compiled code is looked for. Tracing and
calling the compiler for its version take 60 ms with three joints, 150 ms with seven, 220 ms with measured
springs: the time of NumPy for 60,000 to 200,000 samples. From `TRACE_FROM` on NumPy traces as well."""

COMPILER_START_SECONDS = 0.25
COMPILER_SECONDS_PER_OPERATION = 4.5e-5
COMPILER_SECONDS_PER_SQUARE = 1.7e-8
"""Seconds of the compiler: to start, for each operation, and for the square of those of one function.

gcc 12 takes 0.3 s for 1,700 in one function, 0.8 s for 4,700, 1.4 s for 7,000, 4.6 s for 15,000.
"""

CONDITIONAL_OPERATIONS = 80
"""Number of operations as which the compiler takes a loop or branch, in addition to those of its body: 0.6
s for 40 branches among 1,200 operations of one function, 2.0 s for 100 among 2,900, 6.6 s for 200 among
5,800."""

MOST_UNROLLED = 8_000
"""Largest size of a program without calls, in operations, those of loops and branches and their
`CONDITIONAL_OPERATIONS` included: ten joints with cubic springs. Longer ones consist of calls, which are 6
to 9 % slower in C, but compiled in a fraction of the time: 3 s in place of 33 for seven joints with
measured springs."""
