"""Robots, trajectories and files that tests of several rooms share."""

import os

# Read when NumPy is imported, which no module does before this one. The matrices are too small for threads,
# which would wait for each other while another worker has the processor.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
