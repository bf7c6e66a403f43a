"""Strict CSV reading: what is accepted, and what every refusal says."""

import hashlib
import math
import tracemalloc
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsacli.errors import InputError
from vsacli.spec.source import MAX_DOCUMENT_BYTES
from vsacli.spec.table import MAX_HEADER, line_of, read_table


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


def test_line_of_a_row(csv):
    assert problems(csv("a\n0\n1\n2\nx\n"))[0][0] == line_of(3)


@pytest.mark.parametrize("content", ["", "\n", "\ufeff", "  \n1\n", b"\r\n"])
def test_missing_header(csv, content):
    assert problems(csv(content)) == [
        (1, "expected a header line with the names of the columns, found nothing")
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("0.0,1.0\n0.1,2.0\n", "expected a header line with the names of the columns, found numbers"),
        ("a;b\n1;2\n", "expected commas between the columns, found ';'"),
        ("a\tb\n1\t2\n", r"expected commas between the columns, found '\t'"),
        (b"a,\xff\n1,2\n", "expected a header line in UTF-8, found other bytes"),
        ("a,b\n1,2\n".encode("utf-16"), "expected a header line in UTF-8, found other bytes"),
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
    assert problems(csv(content)) == [(0, "there are no rows below the header")]


def test_all_problems_of_the_rows_at_once(csv):
    content = b"time,q\n0,1\n0.1,1,2\n\n0.2\nx,nan\n0.3,1e999\n0.4,\xff\n1_0,\n0x10,1,\n"
    assert problems(csv(content)) == [
        (3, "expected 2 values as in the header, found 3"),
        (4, "the line is empty"),
        (5, "expected 2 values as in the header, found 1"),
        (6, "column 'time': expected a finite number, found 'x'"),
        (6, "column 'q': expected a finite number, found 'nan'"),
        (7, "column 'q': expected a finite number, found '1e999'"),
        (8, "column 'q': expected a finite number, found '\ufffd'"),
        (9, "column 'time': expected a finite number, found '1_0'"),
        (9, "column 'q': expected a finite number, found ''"),
        (10, "expected 2 values as in the header, found 3"),
    ]


@pytest.mark.parametrize(
    "cell", ["nan", "-inf", "Infinity", "1e400", '"1"', "1 2", "1d5", "true", "٣", "1\0"]
)
def test_every_cell_is_a_finite_number(csv, cell):
    assert problems(csv(f"a,b\n1,2\n3,{cell}\n5,6\n")) == [
        (3, f"column 'b': expected a finite number, found {cell!r}")
    ]


def test_rows_that_all_have_the_wrong_length(csv):
    assert problems(csv("a,b,c\n1,2\n3,4\n")) == [
        (2, "expected 3 values as in the header, found 2"),
        (3, "expected 3 values as in the header, found 2"),
    ]


def test_many_problems_are_cut_short(csv):
    found = problems(csv("a\n" + "x\n" * 1000))
    assert [line for line, _ in found] == [*range(2, 12), 0]
    assert found[-1][1] == "more than 10 problems; reading stopped there"


def test_long_cell_is_cut_short(csv):
    ((_, message),) = problems(csv("a\n" + "x" * 10000))
    assert message == f"column 'a': expected a finite number, found {'x' * 40!r}"


def test_directory(tmp_path):
    assert problems(tmp_path) == [(0, "is a directory, expected a file")]


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
    assert line == 1
    assert "header line" in message
    assert peak < 40 * MAX_HEADER  # a few copies of the longest header, not of the file


def reference(content):
    """The table by Python alone, or None if it is to be refused."""
    header, *rows = content.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    while rows and not rows[-1]:
        rows.pop()
    names = [name.strip() for name in header.split(",")]
    try:
        values = [[float(cell) for cell in row.split(",")] for row in rows]
    except ValueError:
        return None
    numbers = [number for row in values for number in row]
    regular = all(len(row) == len(names) for row in values) and all(map(math.isfinite, numbers))
    plain = all(row.isascii() and "_" not in row for row in rows)
    named = all(names) and len(set(names)) == len(names) and names not in (["a;b"], ["1", "2"])
    return values if regular and plain and named and rows else None


NUMBERS = ["0", "1.5", "-2e3", " 7 ", ".5", "1.", "\t3", "+4", "1e-999"]
OTHERS = ["", "nan", "inf", "1e999", "1_0", "x", "1;2", "0x1", "--1"]
cells = st.sampled_from(NUMBERS + OTHERS)
lines = st.lists(cells, min_size=1, max_size=3).map(",".join)
likely_tables = st.builds(
    lambda header, rows, end, bom: ("\ufeff" if bom else "") + end.join([header, *rows]),
    st.sampled_from(["a", "a,b", " a ,b,c", "a,a", "a,", "", "1,2", "a;b"]),
    st.lists(lines | st.just("1,2") | st.just("1") | st.just(""), max_size=6),
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


@given(content=st.binary(max_size=60) | st.text(max_size=60).map(lambda text: ("a,b\n" + text).encode()))
def test_only_input_errors_escape(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    with suppress(InputError):  # either outcome is right; another exception is not
        table = read_table(path)
        assert table.values.shape[1] == len(table.columns)
        assert np.isfinite(table.values).all()
