"""Where the values of a program of calls lie while they are live, as a compiler allocates registers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from vsacli.compute.tracing.program import Kind, Program, Symbol


class Workspace:
    """Places of values; those that a call gives never lie where those do that it takes.

    Args:
        program: one of nothing but calls and their items.
        by_kind: whether values of each kind have places of their own, else all have real ones.

    Attributes:
        slot: place of each value among those of its kind, by index; inputs come first, in their order.
        counts: how many places there are for each kind.
    """

    def __init__(self, program: Program, *, by_kind: bool = False) -> None:
        self._by_kind = by_kind
        self.slot = {symbol.index: place for place, symbol in enumerate(program.inputs)}
        self.counts: dict[Kind, int] = defaultdict(int, {Kind.REAL: len(program.inputs)})
        self._free: dict[Kind, list[int]] = defaultdict(list)
        self._items: dict[int, list[Symbol]] = defaultdict(list)
        self._last_use: dict[int, int] = {}
        for symbol in program.operations:
            if symbol.operation == "item":
                self._items[symbol.operands[0].index].append(symbol)
            else:
                self._last_use |= {value.index: symbol.index for value in values_of(symbol)}
        for kept in (*program.inputs, *program.outputs):
            if isinstance(kept, Symbol):
                self._last_use.pop(kept.index, None)

    def results(self, call: Symbol) -> list[Symbol]:
        """What the next call gives, in the order of the outputs of its body, with places from now on."""
        order = {number: place for place, number in enumerate(call.operands[0].numbers)}
        items = sorted(self._items[call.index], key=lambda item: order[item.operands[1]])
        for item in items:
            self._allocate(item)
        for value in {value.index: value for value in values_of(call)}.values():
            if self._last_use.get(value.index) == call.index:
                self._free[self._pool(value)].append(self.slot[value.index])
        return items

    def _allocate(self, value: Symbol) -> None:
        pool = self._pool(value)
        if not self._free[pool]:
            self._free[pool].append(self.counts[pool])
            self.counts[pool] += 1
        self.slot[value.index] = self._free[pool].pop()

    def _pool(self, value: Symbol) -> Kind:
        return value.kind if self._by_kind else Kind.REAL


def values_of(symbol: Symbol) -> Iterator[Symbol]:
    """The operands of an operation that are no constants."""
    return (operand for operand in symbol.operands if isinstance(operand, Symbol))
