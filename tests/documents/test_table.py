"""Strict CSV reading: what is accepted, and what every refusal says."""

import hashlib
import math
import tracemalloc
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsacli import InputError
from vsacli.documents.csv_file import CHUNK, MAX_HEADER
from vsacli.documents.source import MAX_DOCUMENT_BYTES
from vsacli.documents.table import read_table


@pytest.fixture
def csv(tmp_path):
    def write(content):
        path = tmp_path / "table.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def problems(path):
    with pytest.raises(InputError) as caught:
        read_table(path)
    assert {problem.file for problem in caught.value.problems} == {str(path)}
    return [(problem.line, problem.message) for problem in caught.value.problems]


@pytest.mark.parametrize(
    "content",
    [
        "a,b\n1,2\n3,4e-1\n",
        "a,b\n1,2\n3,4e-1",
        "a,b\r\n1,2\r\n3,4e-1\r\n",
        "\ufeffa,b\n1,2\n3,.4\n",
        " a , b\n 1 ,\t2\n+3, 0.40\n\n\n",
        "a;b\n1; 2\n3;.4\n",
        "a\tb\n1\t 2\n3\t.4\n",
        "a,b\r1,2\r3,.4\r",
        "# grün\n\na,b # both\n#1\n1,2\n\n# 0,0\n3,.4 # the last, with a comma\n#",
    ],
)
def test_tables_that_are_accepted(csv, content):
    table = read_table(csv(content))
    assert table.columns == ("a", "b")
    np.testing.assert_array_equal(table.values, [[1, 2], [3, 0.4]])


def test_numbers_are_read_bit_for_bit(csv):
    bits = np.random.default_rng(0).integers(0, 2**64, 3000, dtype=np.uint64).view(float)
    numbers = np.concatenate([bits[np.isfinite(bits)], [5e-324, -0.0, 0.1, np.finfo(float).max]])
    table = read_table(csv("x\n" + "\n".join(map(repr, numbers.tolist()))))
    np.testing.assert_array_equal(table.values[:, 0].view(np.uint64), numbers.view(np.uint64))


def test_source_records_what_was_read(csv):
    content = "\ufeffgrün,b\r\n1,2\r\n"
    path = csv(content)
    source = read_table(path).source
    assert source.path == str(path)
    assert source.sha256 == hashlib.sha256(content.encode()).hexdigest()
    assert source.text == "grün,b\r\n1,2\r\n"


@pytest.mark.parametrize(("size", "kept"), [(MAX_DOCUMENT_BYTES, True), (MAX_DOCUMENT_BYTES + 2, False)])
def test_text_of_large_files_is_not_kept(csv, size, kept):
    content = "a\n" + "1\n" * (size // 2 - 1)
    source = read_table(csv(content)).source
    assert source.text == (content if kept else None)


@pytest.mark.parametrize("content", ["a\n0\n1\n2\n3\n", "#\n\na\n# 0\n0\n1 #\n\r\n2\n\n\n3"])
def test_line_of_a_row(csv, content):
    path = csv(content)
    table = read_table(path)
    numbers = {line.partition("#")[0].strip(): i for i, line in enumerate(content.splitlines(), 1)}
    assert [table.line_of(row) for row in range(4)] == [numbers[str(row)] for row in range(4)]
    path.unlink()
    assert table.line_of(2) == numbers["2"]
    assert read_table(csv(content)).line_of(4) == 0


def test_line_of_a_row_whose_file_has_gone(csv):
    path = csv("a\n1\n")
    table = read_table(path)
    path.unlink()
    assert table.line_of(0) == 0


@pytest.mark.parametrize("content", ["", "\n", "\ufeff", b"\r\n", "# a,b\n\n"])
def test_missing_header(csv, content):
    assert problems(csv(content)) == [
        (0, "is empty; expected a header line with column names such as time, base.q")
    ]


def test_blanks_are_no_header(csv):
    assert problems(csv("  \n1\n")) == [
        (1, "expected a header line with column names such as time, base.q, found blanks")
    ]


@pytest.mark.parametrize(
    ("cell", "advice"), [("nan", "; delete the row, or fill in the value"), ("x", ""), ("1;5", "")]
)
def test_advice_on_a_missing_value(csv, cell, advice):
    assert problems(csv(f"a,b\n1,{cell}\n")) == [
        (2, f"column 'b': expected a number, found {cell!r}{advice}")
    ]


def test_a_yaml_file_with_the_name_of_a_table(csv):
    ((line, message),) = problems(csv("# a motion\nformat: vsacli-trajectory/1\nname: a\n"))
    assert line == 2
    assert message.endswith("found YAML, 'format: vsacli-trajectory/1'; rename the file to .yaml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "0.0,1.0\n0.1,2.0\n",
            "expected a header line with column names such as time, base.q, found numbers; without one, "
            "columns are given by their numbers, as in columns: {time: 1, elbow.q: 2}",
        ),
        (
            "a,b\0\n1,2\n",
            "expected a header line with column names such as time, base.q in UTF-8, found other bytes",
        ),
        (
            b"a,\xff\n1,2\n",
            "expected a header line with column names such as time, base.q in UTF-8, found other bytes",
        ),
        (
            "a,b\n1,2\n".encode("utf-16"),
            "expected a header line with column names such as time, base.q in UTF-8, found other bytes",
        ),
    ],
)
def test_header_that_is_none(csv, content, message):
    assert problems(csv(content)) == [(1, message)]


def test_all_problems_of_a_header_at_once(csv):
    assert problems(csv("a,,b,a,b,a\n")) == [
        (1, "column 2 has no name"),
        (1, "column 'a' appears 3 times"),
        (1, "column 'b' appears 2 times"),
    ]


@pytest.mark.parametrize("content", ["a,b\n", "a,b", "a,b\n\n\n"])
def test_no_rows(csv, content):
    assert problems(csv(content)) == [(0, "has a header but no rows of values")]


def test_header_in_a_comment_is_recognized(csv):
    assert problems(csv("# written today\n# a,b\n1,2\n")) == [
        (
            3,
            "expected a header line with column names such as time, base.q, found numbers;"
            " if line 2 is meant, remove its '#'",
        )
    ]


def test_first_problem_of_each_kind(csv):
    content = b"time,q\n0,1\n0.1,1,2\n\n0.2\nx,nan\n0.3,1e999\n0.4,\xff\n1_0,\n0x10,1,\n"
    assert problems(csv(content)) == [
        (3, "expected 2 values, one for each column of the header, found 3 (the first of 3 such lines)"),
        (6, "column 'time': expected a number, found 'x' (the first of 2 such lines)"),
        (
            6,
            "column 'q': expected a number, found 'nan'; delete the row, or fill in the value (the first of "
            "4 such lines)",
        ),
    ]


def test_decimal_commas_are_refused_where_commas_separate(csv):
    assert problems(csv("a,b\n1,2\n3,5,4,5\n")) == [
        (
            3,
            "expected 2 values, one for each column of the header, found 4; with decimal commas, semicolons "
            "or tabs stand between the columns",
        )
    ]


@pytest.mark.parametrize("cell", ["-inf", "Infinity", "1e400", "1 2", "1d5", "true", "٣", "9" * 400])
def test_every_cell_is_a_finite_number(csv, cell):
    assert problems(csv(f"a,b\n1,2\n3,{cell}\n5,6\n")) == [
        (3, f"column 'b': expected a number, found {cell[:40]!r}")
    ]


def test_rows_that_all_have_the_wrong_length(csv):
    assert problems(csv("a,b,c\n1,2\n3,4\n")) == [
        (2, "expected 3 values, one for each column of the header, found 2 (the first of 2 such lines)"),
    ]


def test_many_problems_are_cut_short(csv):
    assert problems(csv("a\n" + "x\n" * 5000)) == [
        (2, "column 'a': expected a number, found 'x' (the first of 1000 or more such lines)")
    ]
    names = [f"c{i}" for i in range(30)]
    found = problems(csv(",".join(names) + "\n" + ",".join("x" * 30) + "\n"))
    assert [line for line, _ in found] == [2] * 10 + [0]
    assert found[-1][1] == "more than 10 kinds of problems; reading stopped there"


def test_long_cell_is_cut_short(csv):
    ((_, message),) = problems(csv("a\n" + "x" * 10000))
    assert message == f"column 'a': expected a number, found {'x' * 40!r}"


def test_directory(tmp_path):
    assert problems(tmp_path) == [(0, "is a folder; give the name of a file in it")]


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "absent.csv")


@pytest.mark.parametrize("unit", [b"\0", bytes(range(128, 256)), b"a,"])
def test_large_binary_file_is_refused_from_its_first_line(tmp_path, unit):
    path = tmp_path / "noise.csv"
    path.write_bytes(unit * (20_000_000 // len(unit)))
    tracemalloc.start()
    (line, message), *_ = problems(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    if unit == b"\0":
        assert (line, message) == (0, "is a binary file; expected text")
    else:
        assert line == 1
        assert "header line" in message
    assert peak < 40 * MAX_HEADER  # a few copies of the longest header, not of the file


@pytest.mark.parametrize("unit", [b"\0", b"1,", b"#", b"1", b"\xff"])
def test_large_binary_file_under_a_valid_header_is_refused_early(tmp_path, unit):
    path = tmp_path / "noise.csv"
    path.write_bytes(b"a,b\n" + unit * (20_000_000 // len(unit)))
    tracemalloc.start()
    found = problems(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    nul = "holds NUL characters, which no table of numbers has"
    assert found == [(2, nul if unit == b"\0" else "the line is longer than 1,000,000 characters")]
    assert peak < 5 * CHUNK


@pytest.mark.slow
def test_values_are_those_of_numpy(tmp_path):
    path = tmp_path / "long.csv"
    values = np.random.default_rng(1).normal(size=(3 * CHUNK // 60, 3))  # several chunks
    np.savetxt(path, values, delimiter=",", header="a,b,c", comments="")
    np.testing.assert_array_equal(read_table(path).values, np.loadtxt(path, delimiter=",", skiprows=1))


def reference(content):
    """The table by Python alone, or None if it is to be refused."""
    lines = content.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    filled = [line.partition("#")[0] for line in lines if line and not line.startswith("#")]
    if not filled:
        return None
    header, *rows = filled
    separator = next((mark for mark in "\t;" if mark in header), ",")
    names = [name.strip() for name in header.split(separator)]
    if separator != "," and any("," in row for row in rows):
        if any("." in row for row in rows):
            return None
        rows = [row.replace(",", ".") for row in rows]
    try:
        values = [[float(cell) for cell in row.split(separator)] for row in rows]
    except ValueError:
        return None
    numbers = [number for row in values for number in row]
    regular = all(len(row) == len(names) for row in values) and all(map(math.isfinite, numbers))
    plain = all(row.isascii() and "_" not in row for row in rows)
    named = all(names) and len(set(names)) == len(names) and not all(map(is_finite, names))
    return values if regular and plain and named and rows else None


def is_finite(name):
    try:
        return math.isfinite(float(name)) and "_" not in name
    except ValueError:
        return False


NUMBERS = ["0", "1.5", "-2e3", " 7 ", ".5", "1.", "\t3", "+4", "1e-999"]
OTHERS = ["", "nan", "inf", "1e999", "1_0", "x", "1;2", "0x1", "--1"]
cells = st.sampled_from(NUMBERS + OTHERS)
lines = st.lists(cells, min_size=1, max_size=3).map(",".join)
likely_tables = st.builds(
    lambda header, rows, end, bom: ("\ufeff" if bom else "") + end.join([header, *rows]),
    st.sampled_from(["a", "a,b", " a ,b,c", "a,a", "a,", "", "1,2", "a;b"]),
    st.lists(lines | st.sampled_from(["1,2", "1", "", "# 9", "1,2# 3", "1;2"]), max_size=6),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.booleans(),
)


@given(content=likely_tables)
def test_reader_agrees_with_plain_python(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "likely.csv"
    path.write_bytes(content.encode())
    expected = reference(content)
    if expected is None:
        with pytest.raises(InputError):
            read_table(path)
    else:
        np.testing.assert_array_equal(read_table(path).values, expected)


@settings(deadline=None)  # files take long on a busy disk
@given(content=st.binary(max_size=60) | st.text(max_size=60).map(lambda text: ("a,b\n" + text).encode()))
def test_only_input_errors_escape(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    with suppress(InputError):  # either outcome is right; another exception is not
        table = read_table(path)
        assert table.values.shape[1] == len(table.columns)
        assert np.isfinite(table.values).all()


def test_cells_may_be_empty_where_that_is_admitted(csv):
    path = csv("time; a ;b\n# a comment\n0; ; 1\n0.5;2;nan\n\n1;;3 # three\n")
    with pytest.raises(InputError, match="column 'a': expected a number, found ''"):
        read_table(path)
    table = read_table(path, empty_cells=True)
    assert np.array_equal(table.values, [[0, np.nan, 1], [0.5, 2, np.nan], [1, np.nan, 3]], equal_nan=True)
    assert table.line_of(2) == 6


@pytest.mark.parametrize(
    ("row", "words"), [("1;x", "found 'x'"), ("1;inf", "found 'inf'"), ("1", "expected 2")]
)
def test_other_cells_stay_refused(csv, row, words):
    with pytest.raises(InputError, match=f"table.csv:3: .*{words}"):
        read_table(csv(f"time;a\n0;\n{row}\n"), empty_cells=True)


@pytest.mark.parametrize(
    "content",
    [
        'x;"y; z"\n"1,5";2\n-3;4,25e1\n',
        "x\ty\n1,5\t2\n-3\t4,25e1\n",
        "x;y\r\n1,5;2\r\n-3;4,25e1\r\n",
        '"x","y"\n"1.5",2\n"-3","42.5"\n',
    ],
)
def test_quotes_and_decimal_commas(csv, content):
    np.testing.assert_array_equal(read_table(csv(content)).values, [[1.5, 2], [-3, 42.5]])


@pytest.mark.parametrize("rows", ["1,5;2\n3;4.5\n", "1.5;2,5\n", "1;2\n1.234,5;2\n"])
def test_the_decimal_sign_is_the_same_throughout(csv, rows):
    (found,) = problems(csv(f"x;y\n{rows}"))
    assert "expected a number" in found[1]
    assert (
        "the decimal sign is a comma in some cells and a point in others" in found[1] or "1.234,5" in found[1]
    )
