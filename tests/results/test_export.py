"""Result file to CSV."""

from __future__ import annotations

import csv
import dataclasses
import io

import numpy as np
import pytest
from samples.results import python, random_block, write_result

from vsacli.base.errors import InputError
from vsacli.base.outputs import Outputs
from vsacli.base.variables import Block
from vsacli.results.exports import selection
from vsacli.results.exports.formats import CSV
from vsacli.results.exports.result_format import UndefinedSamplesError, export_result
from vsacli.results.store.reader import StoredResult

SAMPLES = 241
RATE = 1000.0


@pytest.fixture
def block():
    return random_block(SAMPLES, 2, RATE)


@pytest.fixture
def stored(tmp_path):
    """Store a block and open it; closed at the end of the test."""
    opened = []

    def store(block):
        opened.append(StoredResult.open(write_result(tmp_path / f"{len(opened)}.h5", block)))
        return opened[-1]

    yield store
    for result in opened:
        result.close()


def rows(result, *arguments, **options):
    stream = io.StringIO()
    export_result(result, stream, CSV, *arguments, **options)
    return list(csv.reader(io.StringIO(stream.getvalue())))


def without(block, name, *where):
    """The block with NaN at (sample, joint) or (sample, joint, motor) places."""
    values = getattr(block, name).copy()
    for place in where:
        values[place] = np.nan
    return Block(**{**block.arrays(), name: values})


def test_motor_torques_are_the_default(stored, block):
    header, *lines = rows(stored(block))
    assert header == ["time", "j0.tau_motor_1", "j0.tau_motor_2", "j1.tau_motor_1", "j1.tau_motor_2"]
    assert len(lines) == SAMPLES


def test_floats_come_back_bit_for_bit(stored, block):
    values = np.array(rows(stored(block))[1:], dtype=float)
    np.testing.assert_array_equal(values[:, 0], block.time)
    np.testing.assert_array_equal(values[:, 1:].reshape(SAMPLES, 2, 2), block.tau_motor)


def test_extreme_floats_come_back_bit_for_bit(stored, block):
    odd = np.tile([5e-324, -0.0, 1.7976931348623157e308, 0.1, np.inf, 1 / 3], SAMPLES)[: 2 * SAMPLES]
    block = Block(**{**block.arrays(), "tau_e": odd.reshape(SAMPLES, 2)})
    text = np.array(rows(stored(block), ["tau_e"], allow_nan=True)[1:])[:, 1:]
    assert text.astype(float).tobytes() == block.tau_e.tobytes()
    assert text[1, 1] == "0.1"


def test_the_text_of_a_line(stored, block):
    stream = io.StringIO()
    export_result(stored(block), stream, CSV, ["q"])
    lines = stream.getvalue().split("\n")
    assert lines[0] == "time,j0.q,j1.q"
    assert lines[1] == f"0.0,{float(block.q[0, 0])!r},{float(block.q[0, 1])!r}"
    assert lines[-1] == ""


def test_whole_numbers_stay_whole_and_order_is_the_declared_one(stored, block):
    header, first, *_ = rows(stored(block), ["flags", "q"])
    assert header == ["time", "j0.q", "j1.q", "j0.flags", "j1.flags"]
    assert first[3:] == [str(value) for value in block.flags[0]]


@pytest.mark.parametrize("rate", [1000, 500, 125, 1000 / 3, 333.3333])
def test_a_lower_rate_takes_every_nth_sample(stored, block, rate):
    stride = round(RATE / rate)
    result = stored(block)
    assert rows(result, rate=rate)[1:] == rows(result)[1:][::stride]


def test_the_size_of_the_blocks_makes_no_difference(stored, block, monkeypatch):
    result = stored(block)
    expected = rows(result, ["tau_motor", "q"], rate=RATE / 3)
    for cells in (1, 50, 100):
        monkeypatch.setattr(selection, "MAX_BLOCK_VALUES", cells)
        assert rows(result, ["tau_motor", "q"], rate=RATE / 3) == expected


@pytest.mark.parametrize(
    ("rate", "match"),
    [
        (300, "the stored rate of 1000 Hz is not a multiple of 300 Hz; use 250 or 500 Hz"),
        (999, "the stored rate of 1000 Hz is not a multiple of 999 Hz; use 500 or 1000 Hz"),
        (
            2000,
            "2000 Hz exceeds the stored rate of 1000 Hz; use a lower rate, or run invdyn with --set",
        ),
        (0, "the rate must be positive, not 0 Hz"),
        (-5, "the rate must be positive, not -5 Hz"),
        (float("nan"), "the rate must be positive, not nan Hz"),
    ],
)
def test_rates_that_are_not_possible(stored, block, rate, match):
    with pytest.raises(InputError, match=match):
        rows(stored(block), rate=rate)


def test_times_with_six_decimals_have_a_rate(stored, block):
    block = Block(**{**block.arrays(), "time": np.round(np.arange(SAMPLES) / 300, 6)})
    assert len(rows(stored(block), rate=150)) == 1 + SAMPLES // 2 + 1


def test_unequal_steps_have_no_rate(stored, block):
    block = Block(**{**block.arrays(), "time": block.time**2 + block.time})
    result = stored(block)
    assert len(rows(result)) == 1 + SAMPLES
    uneven = (
        r"not equally spaced \(near t = 0\.1\d* s\); set rate: \d+ in the trajectory file"
        " and run invdyn again, or export without --rate"
    )
    with pytest.raises(InputError, match=uneven):
        rows(result, rate=100)


def test_a_single_sample_has_no_rate(stored):
    result = stored(random_block(1, 2))
    assert len(rows(result)) == 2
    with pytest.raises(InputError, match="fewer than two samples"):
        rows(result, rate=100)


def test_a_variable_that_is_not_stored(tmp_path, block):
    stream = io.StringIO()
    path = write_result(tmp_path / "r.h5", block, variables=["q"])
    with (
        StoredResult.open(path) as result,
        pytest.raises(InputError, match="holds no tau_motor; run invdyn again"),
    ):
        export_result(result, stream, CSV)
    assert stream.getvalue() == ""


def test_undefined_samples_are_refused_with_joint_time_and_number(stored, block):
    result = stored(without(block, "tau_motor", (30, 1, 0), (30, 1, 1), (31, 1, 0), (slice(100, 110), 1)))
    stream = io.StringIO()
    with pytest.raises(UndefinedSamplesError) as caught:
        export_result(result, stream, CSV)
    assert stream.getvalue() == ""
    assert [dataclasses.astuple(gap) for gap in caught.value.gaps] == [
        ("j1.tau_motor", "has no value", 0.03, 12)
    ]
    assert str(caught.value).endswith(
        "0.h5: j1.tau_motor has no value at 12 samples, first at t = 0.030 s\n"
        "nothing was exported; fix the steps that the report names, or get empty cells with --allow-nan"
    )


def test_infinite_samples_are_refused_as_well_as_missing_ones(stored, block):
    values = without(block, "q", (7, 1))
    values.q[9:12, 0] = np.inf, -np.inf, np.inf
    with pytest.raises(UndefinedSamplesError) as caught:
        rows(stored(values), ["q"])
    assert list(map(str, caught.value.gaps)) == [
        "j0.q is infinite at 3 samples, first at t = 0.009 s",
        "j1.q has no value at 1 sample, first at t = 0.007 s",
    ]
    assert str(caught.value).endswith(
        "nothing was exported; fix the steps that the report names, or get empty cells with --allow-nan; "
        "export them as they are with --allow-nan"
    )
    lines = rows(stored(values), ["q"], allow_nan=True)[1:]
    assert [cells[1] for cells in lines[9:12]] == ["inf", "-inf", "inf"]
    assert lines[7][2] == ""


def test_undefined_samples_become_empty_cells_on_request(stored, block):
    lines = rows(stored(without(block, "tau_motor", (30, 1, 0))), ["tau_motor", "q"], allow_nan=True)[1:]
    assert lines[30][4] != ""
    assert [(k, cells.index("")) for k, cells in enumerate(lines) if "" in cells] == [(30, 5)]


def test_undefined_samples_between_the_exported_ones_do_not_matter(stored, block):
    result = stored(without(block, "tau_motor", (31, 1)))
    assert len(rows(result, rate=RATE / 2)) == 1 + SAMPLES // 2 + 1
    with pytest.raises(
        UndefinedSamplesError, match=r"j1\.tau_motor has no value at 1 sample, first at t = 0.031 s"
    ):
        rows(result)


def export_file(result, path, variables=None):
    with Outputs() as outputs, outputs.file(path).opened() as stream:
        export_result(result, stream, CSV, variables)


def test_a_file_is_written_under_its_name(stored, block, tmp_path):
    result = stored(block)
    export_file(result, tmp_path / "out.csv", ["q"])
    text = (tmp_path / "out.csv").read_bytes().decode()
    assert list(csv.reader(text.splitlines())) == rows(result, ["q"])
    assert "\r" not in text


def test_a_refused_export_leaves_no_file(stored, block, tmp_path):
    result = stored(without(block, "tau_motor", (0, 0)))
    before = set(tmp_path.iterdir())
    with pytest.raises(UndefinedSamplesError):
        export_file(result, tmp_path / "out.csv")
    assert set(tmp_path.iterdir()) == before


FULL = """
import resource
from vsacli.base.errors import StorageError
from vsacli.base.outputs import Outputs
from vsacli.results.exports.formats import CSV
from vsacli.results.exports.result_format import export_result
from vsacli.results.store.reader import StoredResult

resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
try:
    with (
        StoredResult.open("r.h5") as result,
        Outputs() as outputs,
        outputs.file("out.csv").opened() as stream,
    ):
        export_result(result, stream, CSV)
except StorageError as error:
    print(error)
"""


def test_a_full_disk_leaves_no_file(tmp_path, block):
    write_result(tmp_path / "r.h5", block)
    process = python(FULL, folder=tmp_path)
    output, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    assert output.startswith(
        "out.csv: cannot be written: the file would exceed the largest file size allowed"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
