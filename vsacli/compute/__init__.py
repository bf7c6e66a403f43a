"""Kernels that NumPy runs directly, or that are traced to a program and run by NumPy or compiled C.

`rows` has the interface of a kernel, `control_flow` its loops and conditionals, `vector` its vectors.
`tracing` records a kernel's operations, `engine` runs it. `duals` and `jets` carry derivatives along.
"""
