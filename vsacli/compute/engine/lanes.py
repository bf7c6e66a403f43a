"""C for a program that computes several samples at once, one a lane of a vector register."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any

from vsacli.compute.tracing import Kind, Program, Symbol, is_of_calls
from vsacli.compute.tracing.c_code import Dialect, Writer, digits, table_declarations
from vsacli.compute.tracing.c_functions import VALUES, CallingCode
from vsacli.compute.tracing.c_tables import Place, Tables

_OPERATORS = {"and": " & ", "or": " | "}
_CHOOSE = {
    Kind.REAL: "choose",
    Kind.TRUTH: "choose_integer",
    Kind.BITS: "choose_integer",
    Kind.INDEX: "choose_integer",
}


class VectorDialect(Dialect):
    """Vector types of GCC and Clang, as in lanes.c: comparisons give masks, all bits set or none."""

    def __init__(self) -> None:
        super().__init__({kind: "reals" if kind is Kind.REAL else "integers" for kind in Kind})

    def real(self, number: float) -> str:
        """As of `Dialect`."""
        return f"spread({digits(number)})"

    def array_type(self, _values: tuple[float, ...], _searched: bool) -> str:
        """As of `Dialect`; what is gathered from it is of this type."""
        return "double"

    def entry(self, number: float, _array_type: str) -> str:
        """As of `Dialect`."""
        return digits(number)

    def take(self, place: Place, index: str) -> str:
        """As of `Dialect`."""
        return f"each_take({place.pointer}, {index})"

    def integer(self, number: int) -> str:
        """As of `Dialect`."""
        return f"spread_integer({number})"

    def truth(self, value: bool) -> str:
        """As of `Dialect`."""
        return self.integer(-int(value))

    def logical(self, operator: str, operands: Sequence[str]) -> str:
        """As of `Dialect`."""
        return f"~{operands[0]}" if operator == "not" else _OPERATORS[operator].join(operands)

    def where(self, kind: Kind, truth: str, a: str, b: str) -> str:
        """As of `Dialect`."""
        return f"{_CHOOSE[kind]}({truth}, {a}, {b})"

    def masked(self, truth: str, mask: str) -> str:
        """As of `Dialect`."""
        return f"{truth} & {mask}"

    def function(self, kind: Kind, name: str, operands: Sequence[str]) -> str:
        """As of `Dialect`."""
        if name == "search":
            return f"search({', '.join(operands)})"
        chosen = f"{name}_integer" if kind is Kind.INDEX else name
        return f"each_{chosen}({', '.join(operands)})"

    def any(self, truth: str) -> str:
        """As of `Dialect`."""
        return f"any({truth})"

    def from_slot(self, kind: Kind, slot: str) -> str:
        """As of `Dialect`; other values are kept bit for bit."""
        return slot if kind is Kind.REAL else f"(integers){slot}"

    def to_slot(self, kind: Kind, value: str) -> str:
        """As of `Dialect`."""
        return value if kind is Kind.REAL else f"(reals){value}"

    def from_table(self, entry: str) -> str:
        """As of `Dialect`."""
        return f"spread({entry})"

    def replaced(self, kind: Kind, truth: str, new: str, old: str) -> str:
        """As of `Dialect`."""
        return self.where(kind, truth, new, old)


def batch_source(program: Program) -> str:
    """A translation unit with the function `run` over rows of samples."""
    counts = [f"#define INPUTS {len(program.inputs)}", f"#define OUTPUTS {len(program.outputs)}"]
    support = files("vsacli.compute.engine").joinpath("lanes.c").read_text(encoding="utf-8")
    group = _calling_group(program) if is_of_calls(program) else _group(program)
    return "\n".join([*counts, "", support, *group, ""])


def _group(program: Program) -> Iterator[str]:
    """The function that computes one sample a lane."""
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


def _calling_group(program: Program) -> Iterator[str]:
    """The same for a program of calls: loops copy between the rows and the workspace."""
    tables = Tables([program], VECTORS.array_type)
    yield from table_declarations(tables, VECTORS)
    code = CallingCode("part", program, Writer(VECTORS, tables), VECTORS)
    yield from code.declarations("static __attribute__((noinline))")
    yield "static void group(const double *const *in, double *const *out, int64_t at)"
    yield "{"
    yield f"static _Thread_local reals {VALUES}[{code.slots}];"
    yield "for (int row = 0; row < INPUTS; row++)"
    yield f"{VALUES}[row] = load(in[row] + at);"
    yield from code.statements()
    outputs = list(enumerate(program.outputs))
    computed = [(row, output) for row, output in outputs if isinstance(output, Symbol)]
    for real, name, value in ((True, "reals_to", "{}"), (False, "counts_to", "counted((integers){})")):
        places = [
            (row, code.slot[symbol.index]) for row, symbol in computed if (symbol.kind is Kind.REAL) is real
        ]
        yield from _stores("int", name, places, value.format(f"{VALUES}[{{}}]"))
    constants = [(row, digits(float(output))) for row, output in outputs if not isinstance(output, Symbol)]
    yield from _stores("double", "constants_to", constants, "spread({})")
    yield "}"


def _stores(type_: str, name: str, entries: list[tuple[int, Any]], value: str) -> Iterator[str]:
    """A loop that stores values to rows, both of which follow from a table."""
    if not entries:
        return
    pairs = ", ".join(f"{{{row}, {entry}}}" for row, entry in entries)
    yield f"static const struct {{ int row; {type_} from; }} {name}[] = {{{pairs}}};"
    yield f"for (int n = 0; n < {len(entries)}; n++)"
    yield f"store(out[{name}[n].row] + at, {value.format(f'{name}[n].from')});"


VECTORS = VectorDialect()
