"""C code of a program for several samples at once, one in each lane of a vector register."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from vsacli.compute.tracing import Kind, Program, Symbol, is_of_calls
from vsacli.compute.tracing.c_code import Dialect, Tables, Writer, digits, table_declarations
from vsacli.compute.tracing.c_functions import VALUES, CallingCode

_INTEGERS = [kind for kind in Kind if kind is not Kind.REAL]
_SELECTION: dict[Kind, str] = {
    Kind.REAL: "choose({0}, {1}, {2})",
    **dict.fromkeys(_INTEGERS, "choose_integer({0}, {1}, {2})"),
}


def _lane_function(kind: Kind, name: str) -> str:
    """Return the name of a function in lanes.c."""
    return name if name == "search" else f"each_{name}_integer" if kind is Kind.INDEX else f"each_{name}"


VECTORS = Dialect(
    types={Kind.REAL: "reals", **dict.fromkeys(_INTEGERS, "integers")},
    real=lambda number: f"spread({digits(number)})",
    literal=digits,
    array_type=lambda _values, _searched: "double",
    take=lambda place, index: f"each_take({place.pointer}, {index})",
    function=_lane_function,
    templates={
        "integer": "spread_integer({0})",
        "true": "spread_integer(-1)",
        "false": "spread_integer(0)",
        "and": "{0} & {1}",
        "or": "{0} | {1}",
        "not": "~{0}",
        "bits": "{0} & {1}",
        "any": "any({0})",
        "spread": "spread({0})",
    },
    where=_SELECTION,
    replaced=_SELECTION,
)
"""Vector types of GCC and Clang, as in lanes.c: comparisons give masks, all bits set or none."""


def batch_source(program: Program) -> str:
    """Return a translation unit with the function `run` over rows of samples."""
    counts = [f"#define INPUTS {len(program.inputs)}", f"#define OUTPUTS {len(program.outputs)}"]
    lane_code = files("vsacli.compute.engine").joinpath("lanes.c").read_text(encoding="utf-8")
    group_function = _calling_group_lines(program) if is_of_calls(program) else _group_lines(program)
    return "\n".join([*counts, "", lane_code, *group_function, ""])


def _group_lines(program: Program) -> Iterator[str]:
    """Yield the function that computes one sample in each lane."""
    tables = Tables([program], VECTORS.array_type)
    yield from table_declarations(tables, VECTORS)
    writer = Writer(VECTORS, tables)
    names = {symbol.index: f"x{number}" for number, symbol in enumerate(program.inputs)}
    yield "static void group(const double *const *in, double *const *out, int64_t at)"
    yield "{"
    for number, symbol in enumerate(program.inputs):
        yield f"const reals {names[symbol.index]} = load(in[{number}] + at);"
    yield from writer.statements(program.operations, names)
    for number, output in enumerate(program.outputs):
        kind = output.kind if isinstance(output, Symbol) else Kind.REAL
        value = writer.value(output, kind, names)
        yield f"store(out[{number}] + at, {value if kind is Kind.REAL else f'counted({value})'});"
    yield "}"


def _calling_group_lines(program: Program) -> Iterator[str]:
    """Yield the function for a program of calls: loops copy between the rows and the workspace."""
    tables = Tables([program], VECTORS.array_type)
    yield from table_declarations(tables, VECTORS)
    code = CallingCode("part", program, Writer(VECTORS, tables))
    yield from code.declarations("static __attribute__((noinline))")
    yield "static void group(const double *const *in, double *const *out, int64_t at)"
    yield "{"
    yield f"static _Thread_local reals {VALUES}[{code.slot_count}];"
    yield "for (int row = 0; row < INPUTS; row++)"
    yield f"{VALUES}[row] = load(in[row] + at);"
    yield from code.statements()
    outputs = list(enumerate(program.outputs))
    computed = [(row, output) for row, output in outputs if isinstance(output, Symbol)]
    for real, name, value in ((True, "reals_to", "{}"), (False, "counts_to", "counted((integers){})")):
        slots_of_rows = [
            (row, code.slot[symbol.index]) for row, symbol in computed if (symbol.kind is Kind.REAL) is real
        ]
        yield from _store_loop("int", name, slots_of_rows, value.format(f"{VALUES}[{{}}]"))
    constants = [(row, digits(float(output))) for row, output in outputs if not isinstance(output, Symbol)]
    yield from _store_loop("double", "constants_to", constants, "spread({})")
    yield "}"


def _store_loop(type_: str, name: str, entries: list[tuple[int, Any]], value: str) -> Iterator[str]:
    """Yield a loop that stores values to rows; a table has the indices of both."""
    if not entries:
        return
    pairs = ", ".join(f"{{{row}, {entry}}}" for row, entry in entries)
    yield f"static const struct {{ int row; {type_} from; }} {name}[] = {{{pairs}}};"
    yield f"for (int n = 0; n < {len(entries)}; n++)"
    yield f"store(out[{name}[n].row] + at, {value.format(f'{name}[n].from')});"
