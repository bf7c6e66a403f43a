"""The result file: written atomically, readable with h5py alone; format: docs/formats-results.md."""

from vsacli.base.interrupts import interrupts_deferred

with interrupts_deferred():
    # At exit HDF5 calls into h5py, and crashes if the import of h5py was interrupted.
    import h5py  # noqa: F401  # the modules in here import it themselves
