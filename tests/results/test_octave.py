"""GNU Octave reads the variables of a result that are named to it, as docs/formats-results.md says."""

from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
from samples.marks import needs

SCRIPT = """
result = load("-hdf5", "{path}", "time", "tau_motor");
printf("%d ", size(result.tau_motor));
printf("%.17g ", result.time(end), result.tau_motor(2, 3, 5));
"""


@needs("octave-cli", "octave")
def test_octave_reads_named_variables(feasible_result: Path) -> None:
    command = ["octave-cli", "--norc", "--quiet", "--eval", SCRIPT.format(path=feasible_result)]
    outcome = subprocess.run(command, capture_output=True, text=True, check=True)
    *shape, last_time, torque = map(float, outcome.stdout.split())
    with h5py.File(feasible_result) as file:
        tau_motor, time = file["tau_motor"][...], file["time"][...]
    assert shape == [*tau_motor.shape[::-1]]  # Octave counts dimensions from the fastest on
    np.testing.assert_array_equal([last_time, torque], [time[-1], tau_motor[4, 2, 1]])
