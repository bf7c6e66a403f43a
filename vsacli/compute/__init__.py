"""One text of a computation, carried out by NumPy, as a recorded program, or in C."""
