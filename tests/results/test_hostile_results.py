"""Result files with wrong bytes: refused with a sentence, soon, and within the memory of the file."""

from __future__ import annotations

import json
import random
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
from samples.command_line import ROBOT
from samples.marks import slow_but
from samples.results import random_block, write_result

from vsacli import InputError, open_result
from vsacli.results.store import damage
from vsacli.results.store.reader import StoredResult

CASES = 60
SECONDS = 30
"""For all cases together, which take a few; a hang takes forever."""

READER = """
import resource, sys
from vsacli import InputError, StorageError
from vsacli.files.info import describe_file, render
from vsacli.files.validation import check_files

folder, cases = sys.argv[1], int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
for case in range(cases):
    path = f"{folder}/{case}.h5"
    print(case, flush=True)
    try:
        checked = check_files([path])
        render(describe_file(path))
    except (InputError, StorageError) as error:
        assert len(str(error)) < 1000, error
used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
assert used < 500, f"{used} MB"
print("done")
"""

LAUNCH = "import subprocess, sys; sys.exit(subprocess.run(sys.argv[1:]).returncode)"
"""Run a command from a small process: peak memory begins with that of the process that starts another."""


def damaged(content: bytes, random_numbers: random.Random) -> bytes:
    """The content cut short, or with a few of its bytes changed."""
    if random_numbers.random() < 0.15:
        return content[: random_numbers.randrange(len(content))]
    changed = bytearray(content)
    for _ in range(random_numbers.choice([1, 1, 2, 8, 64])):
        place = random_numbers.randrange(len(changed))
        match random_numbers.randrange(4):
            case 0:
                changed[place] ^= 1 << random_numbers.randrange(8)
            case 1:
                changed[place] = random_numbers.choice([0, 1, 127, 128, 255])
            case 2:
                other = random_numbers.randrange(len(changed))
                changed[place : place + 16] = changed[other : other + 16]
            case 3:
                changed[place : place + 8] = random_numbers.choice([0, 2**63, 2**31]).to_bytes(8, "little")
    return bytes(changed)


@pytest.fixture(scope="module")
def small_result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result of few samples, so that most of its bytes are structure."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "move.yaml").write_text(
        "format: vsacli-trajectory/1\nname: short\nduration: 0.1\nrate: 100\n"
        "position: {type: constant, value: 0.5}\nstiffness: {type: constant, value: 1000}\n"
    )
    command = [sys.executable, "-m", "vsacli", "invdyn", ROBOT, "move.yaml", "-q", "-o", "r.h5"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "r.h5"


@pytest.mark.slow
def test_any_bytes_are_read_or_refused(small_result: Path, tmp_path: Path) -> None:
    content, random_numbers = small_result.read_bytes(), random.Random(1)
    for case in range(CASES):
        (tmp_path / f"{case}.h5").write_bytes(damaged(content, random_numbers))
    done = subprocess.run(
        [sys.executable, "-c", LAUNCH, sys.executable, "-c", READER, str(tmp_path), str(CASES)],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert done.returncode == 0, f"case {done.stdout.split()[-1]}\n{done.stderr}"
    assert done.stdout.split()[-1] == "done"


def heap_object(content: bytes, index: int) -> int:
    """Offset of an object of the first heap of texts."""
    start = content.index(b"GCOL\x01\0\0\0")
    position = start + 16
    for _ in range(index):
        position += 16 + -(-struct.unpack_from("<Q", content, position + 8)[0] // 8) * 8
    return position


@pytest.mark.parametrize(
    ("fields", "form"),
    [((0, 0, 0, 0), "<HHIQ"), ((1, 0, 0, 2**63), "<HHIQ"), ((1, 0, 0, 2**64 - 1), "<HHIQ")],
    ids=["endless loop", "beyond the heap", "wraps around"],
)
def test_a_heap_of_texts_that_never_ends(
    small_result: Path, tmp_path: Path, fields: tuple[int, ...], form: str
) -> None:
    content = bytearray(small_result.read_bytes())
    struct.pack_into(form, content, heap_object(bytes(content), 3), *fields)
    (tmp_path / "r.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"r.h5: is damaged or truncated; compute it again"):
        StoredResult.open(tmp_path / "r.h5")


def test_opening_reads_no_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many there are: what is read at opening is the beginning, labels and the report."""
    read = []

    class Counting(damage._CheckedBytes):
        def readinto(self, buffer: Any) -> int:
            read.append(memoryview(buffer).nbytes)
            return super().readinto(buffer)

    path = write_result(tmp_path / "r.h5", random_block(20_000, 2), step=5000)
    monkeypatch.setattr(damage, "_CheckedBytes", Counting)
    with StoredResult.open(path) as result:
        assert path.stat().st_size > 5_000_000
        assert sum(read) < 100_000  # bytes; heaps of texts have 4096 each
        read.clear()
        result.read("phi", 0, 1)
        assert sum(read) >= result.read("phi").nbytes / 2  # two chunks hold it


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("export r.h5 --variables tau_motor", 0),
        ("info r.h5", 0),
        ("export r.h5 --variables flags", 2),
        ("plot r.h5 -o figures", 2),
        ("validate r.h5", 2),
        ("validate r.h5 --recompute", 2),
    ],
)
def test_damage_matters_where_it_is_read(vsacli: Any, small_result: Path, line: str, code: int) -> None:
    with_damaged_flags(small_result, Path("r.h5"))
    done = vsacli(*line.split())
    assert done.code == code
    if code:
        assert "r.h5: variable flags is damaged or truncated;" in done.out + done.err
        assert "; compute it again\n" in done.out + done.err
        assert not Path("figures").exists()


def with_damaged_flags(small_result: Path, path: Path) -> None:
    """Copy a result and change bytes of a variable that is compressed."""
    shutil.copy(small_result, path)
    with h5py.File(path, "r+") as file:
        where = file["flags"].id.get_chunk_info(0)
    with path.open("r+b") as raw:
        raw.seek(where.byte_offset)
        raw.write(b"no deflate"[: where.size])


def test_a_damaged_variable_is_no_missing_attribute(small_result: Path, tmp_path: Path) -> None:
    with_damaged_flags(small_result, tmp_path / "r.h5")
    with open_result(tmp_path / "r.h5") as result:
        assert result.phi.shape == (11, 3, 2)
        with pytest.raises(InputError, match="variable flags is damaged or truncated"):
            result.flags  # noqa: B018 - reading is what fails


def test_damage_of_an_attribute_is_found(vsacli: Any, small_result: Path) -> None:
    """One that nothing but `validate` reads: the heap that holds the text is no heap any more."""
    content = small_result.read_bytes()
    heaps = [found.start() for found in re.finditer(rb"GCOL\x01\0\0\0", content)]
    found = 0
    for heap in heaps:
        changed = bytearray(content)
        changed[heap + 16 : heap + 32] = bytes(16)
        Path("r.h5").write_bytes(changed)
        done = vsacli("validate", "r.h5")
        assert (done.code, "r.h5: is damaged or truncated;" in done.out + done.err) == (2, True), done
        found += vsacli("export", "r.h5").code == 0
    assert found  # at least one of them is no hindrance to an export


def test_a_text_is_not_longer_than_the_file(small_result: Path, tmp_path: Path) -> None:
    with h5py.File(small_result) as file:
        offset = file["joint_type"].id.get_offset()
    content = bytearray(small_result.read_bytes())
    struct.pack_into("<I", content, offset, 2**32 - 1)
    (tmp_path / "r.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"r.h5: is damaged .*joint_type claims texts of 4,294,967,"):
        StoredResult.open(tmp_path / "r.h5")


def with_claim(path: Path, name: str, shape: tuple[int, ...], chunks: tuple[int, ...]) -> None:
    """Replace a dataset by one of another shape, of which nothing is stored."""
    with h5py.File(path, "r+") as file:
        kind = file[name].dtype
        del file[name]
        file.create_dataset(name, shape=shape, dtype=kind, chunks=chunks)


@pytest.mark.parametrize(
    ("name", "shape", "chunks"),
    [
        ("time", (10**12,), (1000,)),
        ("joint", (10**12,), (1000,)),
        ("tau_motor", (10**12, 3, 2), (1000, 3, 2)),
        ("tau_motor", (11, 3, 10**9), (11, 3, 1000)),
        ("flags", (11, 3), (11, 3)),
    ],
)
def test_shapes_are_not_believed(
    vsacli: Any, small_result: Path, name: str, shape: tuple[int, ...], chunks: tuple[int, ...]
) -> None:
    shutil.copy(small_result, "r.h5")
    with_claim(Path("r.h5"), name, shape, chunks)
    done = vsacli("export", "r.h5", "-o", "r.csv")
    if name == "flags":  # of the right shape, so nothing is wrong
        assert done.code == 0
    else:
        assert done.code == 2
        part = "" if name in ("time", "joint") else f"variable {name} "
        assert done.err.startswith(f"r.h5: {part}is damaged or truncated (")
        assert not Path("r.csv").exists()


def test_a_chunk_is_not_larger_than_the_file(small_result: Path, tmp_path: Path) -> None:
    """By its shape: 1.6 GB, all of which HDF5 would allocate to read one row."""
    path = tmp_path / "r.h5"
    shutil.copy(small_result, path)
    with h5py.File(path, "r+") as file:
        shape = file["tau_motor"].shape
        del file["tau_motor"]
        file.create_dataset(
            "tau_motor", shape, "<f8", maxshape=(None, *shape[1:]), chunks=(2**25, *shape[1:])
        )
    with StoredResult.open(path) as result:
        result.read("phi")
        with pytest.raises(InputError, match=r"tau_motor claims chunks of 1,610,612,736 bytes in a file of"):
            result.read("tau_motor", 0, 1)


def test_a_compressed_chunk_is_not_larger_than_the_file(small_result: Path, tmp_path: Path) -> None:
    """By the index of chunks: a key of size, mask of filters and place of the chunk, then its address."""
    with h5py.File(small_result) as file:
        chunk = file["flags"].id.get_chunk_info(0)
    content = bytearray(small_result.read_bytes())
    entry = struct.pack("<IIQQQQ", chunk.size, 0, 0, 0, 0, chunk.byte_offset)
    struct.pack_into("<I", content, content.index(entry), 2**31)
    (tmp_path / "r.h5").write_bytes(content)
    match = r"flags claims chunks of 2,147,483,648 bytes in a file of"
    with StoredResult.open(tmp_path / "r.h5") as result, pytest.raises(InputError, match=match):
        result.read("flags")


@pytest.mark.parametrize("report", ["[]", "1", "{", "[" * 100_000, '{"a": NaN'], ids=len)
def test_reports_that_are_none(vsacli: Any, small_result: Path, report: str) -> None:
    shutil.copy(small_result, "r.h5")
    with h5py.File("r.h5", "r+") as file:
        del file["report/json"]
        file["report/json"] = report
    done = vsacli("info", "r.h5")
    assert done.code == 2
    assert re.match(r"r\.h5: is damaged or truncated( \(report/json is no JSON object\))?; compute", done.err)
    assert len(done.err) < 400


@pytest.mark.parametrize("report", [{}, {"joints": None}, {"joints": [[{"name": 5}]], "x": {"y": []}}])
def test_a_report_of_another_shape_is_left_to_json(vsacli: Any, small_result: Path, report: Any) -> None:
    shutil.copy(small_result, "r.h5")
    with h5py.File("r.h5", "r+") as file:
        del file["report/json"]
        file["report/json"] = json.dumps(report)
    done = vsacli("info", "r.h5")
    assert (done.code, done.err) == (0, "")
    assert done.out.endswith("\nits report has another form than this version writes; --json shows it\n")
    assert json.loads(vsacli("info", "r.h5", "--field", "report").out) == report


@pytest.mark.parametrize("attribute", ["created", "versions", "command_line"])
def test_provenance_that_is_missing(vsacli: Any, small_result: Path, attribute: str) -> None:
    shutil.copy(small_result, "r.h5")
    with h5py.File("r.h5", "r+") as file:
        del file.attrs[attribute]
    done = vsacli("info", "r.h5")
    assert (done.code, done.out) == (2, "")
    assert "is damaged or truncated" in done.err


ROOT = ("generated_by", "created", "command_line", "engine", "compiler", "threads", "options", "versions")
OF_ROOT = ("format", *ROOT, "robot_name", "trajectory_name", "verdict", "complete", "Conventions")
OF_VARIABLES = {
    "tau_e": ("units", "long_name", "equation", "coordinates", "DIMENSION_LIST"),
    "flags": ("flag_masks", "flag_meanings"),
    "time": ("units", "long_name", "equation"),
    "inputs/file_1": ("path", "sha256"),
}
NEEDED = [
    *(("/", name) for name in OF_ROOT),
    *((at, name) for at, names in OF_VARIABLES.items() for name in names),
]


QUICK = [("/", "compiler"), ("/", "created"), ("tau_e", "units")]


@pytest.mark.parametrize("place", slow_but(QUICK, NEEDED), ids="-".join)
def test_an_attribute_that_is_missing_is_named(
    vsacli: Any, small_result: Path, place: tuple[str, str]
) -> None:
    at, attribute = place
    shutil.copy(small_result, "r.h5")
    with h5py.File("r.h5", "r+") as file:
        del file[at].attrs[attribute]
    checked = vsacli("validate", "r.h5")
    assert (checked.code, attribute in checked.out) == (2, True)
    assert vsacli("info", "r.h5").code in (0, 2)  # it shows what it can, and no traceback


def test_no_attribute_is_forgotten_above(small_result: Path) -> None:
    """Those of groups, scales and roles are for other programs, or may be absent."""
    found = set()
    with h5py.File(small_result) as file:
        found |= {("/", name) for name in file.attrs}
        for at in OF_VARIABLES:
            found |= {(at, name) for name in file[at].attrs}
    assert found - set(NEEDED) == {
        *(("flags", name) for name in OF_VARIABLES["tau_e"]),
        *(("time", name) for name in ("CLASS", "NAME", "REFERENCE_LIST")),
        ("inputs/file_1", "role"),
    }


def test_a_link_to_another_file_is_not_followed(vsacli: Any, small_result: Path) -> None:
    shutil.copy(small_result, "r.h5")
    shutil.copy(small_result, "other.h5")
    with h5py.File("r.h5", "r+") as file:
        del file["tau_e"]
        file["tau_e"] = h5py.ExternalLink("other.h5", "/tau_e")
    done = vsacli("validate", "r.h5")
    assert done.code == 2
    assert "tau_e" in done.out


def test_a_path_with_a_nul(vsacli: Any) -> None:
    done = vsacli("export", "a\0b.h5")
    assert (done.code, done.err) == (2, "a\\x00b.h5: the path holds a NUL character\n")
