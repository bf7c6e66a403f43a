"""The test program that comes with generated code: reference vectors, and a comparison with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.compute.tracing.c_code import digits
from vsacli.control.codegen.interface import Array, Function
from vsacli.control.codegen.reference_vectors import CASES, Arrays, Reference

TOLERANCE = {"double": 1e-9, "float": 2e-3}
"""Largest difference from NumPy, relative to the largest value of an array; rounding grows with the condition
of the mass matrix, and towards singularities."""

BOUNDED, BOUND = "stiffness_upper", 100.0
"""A result that is compared up to this many times the largest stiffness demanded: what lies beyond decides
nothing, and where a linkage is stretched it is as inaccurate as its geometry makes it."""

_COMPARISON = """static double at_most(double value, double bound)
{{
    return value > bound ? bound : value;
}}

/* Whether a value is missing, or differs by more than rounding from what NumPy computes. */
static int differs(const char *name, int number, double found, double expected, double scale)
{{
    const int both_missing = found != found && expected != expected;
    if (both_missing || found == expected || fabs(found - expected) <= {tolerance} * scale)
        return 0;
    printf("case %d: %s is %.17g, expected %.17g\\n", number, name, found, expected);
    return 1;
}}"""


def self_test_text(
    prefix: str, functions: Sequence[Function], reference: Reference, precision: str, head: str
) -> str:
    """The test program; arguments as of `vsacli.control.codegen.scalar.source_text`."""
    parts = [
        head,
        f'#include "{prefix}.h"\n\n#include <math.h>\n#include <stdio.h>',
        f"enum {{ CASES = {CASES} }};",
        _COMPARISON.format(tolerance=TOLERANCE[precision]),
    ]
    for function in functions:
        parts += _vectors(prefix, function, reference)
        parts.append("\n".join(_test(prefix, function, reference)))
    calls = " + ".join(f"test_{function.name}()" for function in functions)
    parts.append(
        f"int main(void)\n{{\n    const int failures = {calls};\n"
        '    printf(failures ? "%d values differ\\n" : "all values agree\\n", failures);\n'
        "    return failures != 0;\n}"
    )
    return "\n\n".join(parts) + "\n"


def _vectors(prefix: str, function: Function, reference: Reference) -> Iterator[str]:
    """The inputs and the expected results of a function."""
    arguments = zip(function.arguments, reference.inputs(function), strict=True)
    for (name, structure), arrays in arguments:
        yield _vector(f"{prefix}_{structure.name} {function.name}_{name}", structure.arrays, arrays)
    result = function.result
    yield _vector(
        f"{prefix}_{result.name} {function.name}_expected", result.arrays, reference.results(function)
    )


def _vector(declared: str, arrays: Sequence[Array], values: Arrays) -> str:
    cases = [
        "    {"
        + ", ".join(
            f".{array.name} = {_initializer(values[array.name][case], array.bits)}" for array in arrays
        )
        + "},"
        for case in range(CASES)
    ]
    return "\n".join([f"static const {declared}[CASES] = {{", *cases, "};"])


def _initializer(values: FloatArray, bits: bool) -> str:
    if values.ndim:
        return "{" + ", ".join(_initializer(entry, bits) for entry in values) + "}"
    return f"{int(values)}u" if bits else digits(float(values))


def _test(prefix: str, function: Function, reference: Reference) -> Iterator[str]:
    results = reference.results(function)
    own = function.name
    yield f"static int test_{own}(void)\n{{"
    yield "    int failures = 0;"
    yield "    for (int n = 0; n < CASES; n++) {"
    yield f"        const {prefix}_{function.result.name} *const expected = &{own}_expected[n];"
    yield f"        {prefix}_{function.result.name} found;"
    given = ", ".join(f"&{own}_{name}[n]" for name, _ in function.arguments)
    yield f"        {prefix}_{own}({given}, &found);"
    for array in function.result.arrays:
        values = results[array.name]
        if array.name == BOUNDED:
            values = np.minimum(values, BOUND * reference.largest_stiffness)
        scale = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        for entry in array.entries:
            both = f"found.{entry}", f"expected->{entry}"
            if array.name == BOUNDED:
                both = f"at_most({both[0]}, {digits(scale)})", f"at_most({both[1]}, {digits(scale)})"
            yield (f'        failures += differs("{own}: {entry}", n, {", ".join(both)}, {digits(scale)});')
    yield "    }\n    return failures;\n}"
