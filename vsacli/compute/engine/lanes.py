"""C for a program that computes several samples at once, one a lane of a vector register."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files

from vsacli.compute.tracing import Kind, Program, Symbol
from vsacli.compute.tracing.c_code import Dialect, Writer, digits, table_declarations
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

    def replaced(self, kind: Kind, truth: str, new: str, old: str) -> str:
        """As of `Dialect`."""
        return self.where(kind, truth, new, old)


def batch_source(program: Program) -> str:
    """A translation unit with the function `run` over rows of samples."""
    counts = [f"#define INPUTS {len(program.inputs)}", f"#define OUTPUTS {len(program.outputs)}"]
    support = files("vsacli.compute.engine").joinpath("lanes.c").read_text(encoding="utf-8")
    return "\n".join([*counts, "", support, *_group(program), ""])


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
    yield from writer.statements(program, names)
    for number, output in enumerate(program.outputs):
        kind = output.kind if isinstance(output, Symbol) else Kind.REAL
        value = writer.value(output, kind, names)
        yield f"store(out[{number}] + at, {value if kind is Kind.REAL else f'counted({value})'});"
    yield "}"


VECTORS = VectorDialect()
