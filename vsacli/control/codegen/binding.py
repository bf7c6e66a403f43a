"""A Python module that calls generated code: what a controller is tested with."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from vsacli.base.flags import Flag
from vsacli.base.texts import one_line
from vsacli.control.codegen.interface import Array, Function, Structure, structures
from vsacli.control.codegen.scalar import WIDTH

_HEAD = '''{about}
"""The functions of {prefix}.c, called from Python. Importing this compiles them, by make.

    import numpy as np
    import {prefix}

    command = np.zeros(1000, {prefix}.Command)  # a record for each sample; np.zeros((), ...) for one
    command["q"] = ...
    drive, flags = {prefix}.{call}
    drive["tau_motor"]

Data types are the structures of {prefix}.h, which gives the units. Functions take arrays of records, spread
against one another, and give as many records of what they compute, and the flags that the C function returns.
"""

import ctypes
import enum
import subprocess
from pathlib import Path

import numpy as np

_FOLDER = Path(__file__).resolve().parent
subprocess.run(["make", "--silent", "lib{prefix}.so"], cwd=_FOLDER, check=True)
_LIBRARY = ctypes.CDLL(str(_FOLDER / "lib{prefix}.so"))


def _call(function, result, *arguments):
    """Results and returned flags of a function of C, from pairs of an argument and its type."""
    for argument, expected in arguments:
        if np.asarray(argument).dtype != expected:
            raise TypeError(f"{{function.__name__}}: expected records of {{', '.join(expected.names)}}")
    spread = np.broadcast_arrays(*(argument for argument, _ in arguments))
    found = np.zeros(spread[0].shape, result)
    flags = np.zeros(spread[0].shape, np.uint32)
    function.restype = ctypes.c_uint
    for index in np.ndindex(found.shape):
        records = [each[index].tobytes() for each in spread]
        record = ctypes.create_string_buffer(result.itemsize)
        flags[index] = function(*records, record)
        found[index] = np.frombuffer(record, result)[0]
    return found, flags'''

_FUNCTION = """def {name}({arguments}):
{meaning}
    return _call(_LIBRARY.{prefix}_{name}, {result}{given})"""

_NOMINAL = """_CONSTANT = (ctypes.c_char * {type}.itemsize).in_dll(_LIBRARY, "{prefix}_nominal_{name}")
NOMINAL_{upper} = np.frombuffer(_CONSTANT.raw, {type})[0]"""


def binding_text(prefix: str, functions: Sequence[Function], precision: str, about: str) -> str:
    """The module; arguments as of `vsacli.control.codegen.scalar.source_text`, and what comes first in it."""
    used = structures(functions)
    loop = next((each for each in functions if each.name == "inverse_dynamics"), functions[0])
    call = f"{loop.name}({', '.join(name for name, _ in loop.arguments)})"
    comments = textwrap.wrap(one_line(about), WIDTH, initial_indent="# ", subsequent_indent="# ")
    parts = [
        _HEAD.format(about="\n".join(comments), prefix=prefix, call=call),
        "\n".join(_flags()),
        "\n\n".join(_data_type(each, precision) for each in used),
        *(_function(prefix, each) for each in functions),
        *(_nominal(prefix, each) for each in used if each.nominal),
    ]
    return "\n\n\n".join(parts) + "\n"


def _flags() -> Iterator[str]:
    yield 'class Flag(enum.IntFlag):\n    """Bits of flags: what is wrong with a joint."""\n'
    for flag in Flag:
        yield f"    {flag.name} = {flag.value}  # {flag.meaning}"


def _type(structure: Structure) -> str:
    return structure.name.capitalize()


def _data_type(structure: Structure, precision: str) -> str:
    """The type of a structure, laid out as C has it."""
    members = "".join(f"        {_member(array, precision)},\n" for array in structure.arrays)
    return f"{_type(structure)} = np.dtype(\n    [\n{members}    ],\n    align=True,\n)"


def _member(array: Array, precision: str) -> str:
    number = "np.uintc" if array.bits else {"double": "np.float64", "float": "np.float32"}[precision]
    return f'("{array.name}", {number}, {array.shape})'


def _function(prefix: str, function: Function) -> str:
    """A function with the arguments of that of C."""
    return _FUNCTION.format(
        prefix=prefix,
        name=function.name,
        arguments=", ".join(name for name, _ in function.arguments),
        meaning=textwrap.fill(
            f'"""{function.meaning}"""', WIDTH, initial_indent="    ", subsequent_indent="    "
        ),
        result=_type(function.result),
        given="".join(f", ({name}, {_type(structure)})" for name, structure in function.arguments),
    )


def _nominal(prefix: str, structure: Structure) -> str:
    """The constant of a structure."""
    return _NOMINAL.format(
        prefix=prefix, name=structure.name, upper=structure.name.upper(), type=_type(structure)
    )
