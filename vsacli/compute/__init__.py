"""One text of a computation, carried out by NumPy, as a traced program, or in C."""
