"""Input files: their content, for the provenance of a result, and their problems.

A file of another program is recognized, and the error names the command that converts it.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import NamedTuple, NoReturn

from vsacli.base.did_you_mean import near_file
from vsacli.base.errors import InputError, Problem
from vsacli.base.storage import STANDARD, place_of

MAX_DOCUMENT_BYTES = 1_000_000
"""Maximum size (bytes) of text documents, and of input files whose text is kept in results."""


MAX_PROBLEMS = 50
"""Number of problems after which reading stops; more would not help the user."""

IN_PACKAGE = "package://"
"""Prefix of file names in ROS packages, which only ROS can resolve."""

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file, the format of results."""


class Source(NamedTuple):
    """An input file that was read.

    Attributes:
        path: path as given.
        sha256: digest of the content, hexadecimal.
        text: text of the file; None if it is too large to keep.
        changes: changes applied after reading, as JSON of values by path; empty without changes.
    """

    path: str
    sha256: str
    text: str | None
    changes: str = ""


def read_source(
    path: str | os.PathLike[str], max_bytes: int = MAX_DOCUMENT_BYTES, expected: str = ""
) -> tuple[Source, str]:
    """Read a complete text document.

    Args:
        path: path of the file, repeated in errors as given.
        max_bytes: size above which the file is refused without being read.
        expected: clause of the error of an empty file, `expected ...`.

    Returns:
        The source, and its text without a byte order mark.

    Raises:
        InputError: the file is missing, not regular, unreadable, empty, too large or not UTF-8.
    """
    name = os.fspath(path)
    check_input_file(name, max_bytes)
    with _refusing(name), open(place_of(name), "rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:  # the file grew after its size was checked
        raise _too_large(name, len(content), max_bytes)
    if not content.strip():
        raise InputError.one("is empty" + (f"; {expected}" if expected else ""), name)
    text = decode_utf8(content, name)
    return Source(name, hashlib.sha256(content).hexdigest(), text), text


def is_table(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a CSV table, by its name; standard input and texts, by their first line.

    Raises:
        InputError: standard input or a text cannot be read.
    """
    name = os.fspath(path)
    if name != STANDARD and not name.lower().endswith(ENDINGS_OF_TEXTS):
        return name.lower().endswith(".csv")
    with _refusing(name), open(place_of(name), encoding="utf-8-sig", errors="replace") as file:
        lines = (line for line in iter(lambda: file.readline(BEGINNING_BYTES), "") if line.strip())
        first = next((line for line in lines if not line.startswith("#")), ":")
        row = first if name == STANDARD else first + next(lines, "")
    return _BEGINNING_OF_DOCUMENTS.match(first) is None and (name == STANDARD or bool(_DIGIT.search(row)))


def check_input_file(path: str | os.PathLike[str], max_bytes: int = sys.maxsize) -> None:
    """Refuse a path, before it is opened, unless it is a regular file of at most `max_bytes`.

    Raises:
        InputError: with the kind of the object at the path.
    """
    name = os.fspath(path)
    with _refusing(name):
        status = os.stat(place_of(name))
    if stat.S_ISDIR(status.st_mode):
        raise InputError.one("is a folder; give the name of a file in it", name)
    if not stat.S_ISREG(status.st_mode):
        raise InputError.one("is not a regular file (a device, pipe or socket)", name)
    if status.st_size > max_bytes:
        with _refusing(name), open(place_of(name), "rb") as file:
            start = file.read(len(HDF5_SIGNATURE))
        _refuse_hdf5(start, name)
        raise _too_large(name, status.st_size, max_bytes)


def decode_utf8(content: bytes, name: str) -> str:
    """Return the text of a file's content, without a byte order mark.

    Raises:
        InputError: naming the first byte that is not UTF-8.
    """
    _refuse_hdf5(content, name)
    try:
        return content.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        byte = content[error.start]
        line = content.count(b"\n", 0, error.start) + 1
        problem = f"byte 0x{byte:02x} is not valid UTF-8; save the file as UTF-8"
        raise InputError.one(problem, name, line) from None


def _refuse_hdf5(content: bytes, name: str) -> None:
    if content.startswith(HDF5_SIGNATURE):
        raise InputError.one("is an HDF5 file, such as a result; expected text", name)


@contextmanager
def _refusing(name: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise InputError.one(f"no such file{_hint_for_missing_file(name)}", name) from None
    except OSError as error:
        raise InputError.one(f"cannot be read: {error.strerror}", name) from None
    except ValueError:
        raise InputError.one("the path holds a NUL character", name) from None


def _hint_for_missing_file(name: str) -> str:
    if name.startswith(IN_PACKAGE):
        package, _, rest = name.removeprefix(IN_PACKAGE).partition("/")
        return f"; of a file in a ROS package give the path, $(ros2 pkg prefix --share {package})/{rest}"
    return near_file(Path(name))


def _too_large(name: str, size: int, max_bytes: int) -> InputError:
    return InputError.one(f"the file has {size:,} bytes, more than the {max_bytes:,} allowed here", name)


class Problems:
    """The problems of one file.

    Every problem of a document is added here while reading continues; `check` raises them together.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self._problems: list[Problem] = []
        self._faults: set[tuple[int, str]] = set()

    def add(self, line: int, message: str, fault: str = "") -> None:
        """Note a problem.

        Args:
            line: line number from 1, or 0.
            message: as in `Problem`.
            fault: message without units. A value that an alias repeats at joints of several types is noted
                once.

        Raises:
            InputError: there are more than MAX_PROBLEMS.
        """
        if fault and (line, fault) in self._faults:
            return
        self._faults.add((line, fault))
        if len(self._problems) == MAX_PROBLEMS:
            self._problems.append(
                Problem(self.file, line, f"more than {MAX_PROBLEMS} problems; reading stopped here")
            )
            self.check()
        self._problems.append(Problem(self.file, line, message))

    def include(self, error: InputError) -> None:
        """Note the problems of another file that this file refers to."""
        self._problems.extend(error.problems)

    def fail(self, line: int, message: str) -> NoReturn:
        """Raise this problem, after which nothing can be read, with all problems found so far."""
        raise InputError(self._in_order(Problem(self.file, line, message)))

    def check(self) -> None:
        """Raise the problems found, if any.

        Raises:
            InputError: with every problem once, ordered by line.
        """
        if self._problems:
            raise InputError(self._in_order())

    def _in_order(self, *last: Problem) -> list[Problem]:
        return sorted(
            dict.fromkeys([*self._problems, *last]), key=lambda problem: (problem.file != self.file, problem)
        )


ENDINGS_OF_TEXTS = (".txt", ".dat", ".tsv", ".log")
"""Endings of files that may be tables or documents."""

_DIGIT = re.compile(r"\d")
_BEGINNING_OF_DOCUMENTS = re.compile(r"\s*([{<\0\ufffd]|---|[\w\"'-]*\s*:(\s|$))")

UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of texts in UTF-16, whose error says that UTF-8 is expected."""

BEGINNING_BYTES = 4096
"""Bytes to read to find the first tag after an XML declaration and a license."""

_ROOT_TAG = re.compile(r"<\s*([A-Za-z][\w.-]*)")
_COMMENT = re.compile(r"<!--.*?(-->|\Z)", re.DOTALL)

SIGNATURES = {
    b"\x89PNG\r\n": "png",
    b"\xff\xd8\xff": "jpeg",
    b"%PDF-": "pdf",
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"MATLAB ": "mat",
    b"#ROSBAG": "bag",
    b"\x89MCAP": "mcap",
    b"SQLite format 3": "db3",
    b"PAR1": "parquet",
    b"\x93NUMPY": "npy",
}
"""First bytes of file formats, with the file name ending of each."""

ENDINGS = {"xls": "xlsx", "ods": "xlsx", "npz": "npy", "mjb": "mujoco"}
"""File name endings that are treated like others."""

SENTENCES = {
    "urdf": "is a URDF; make a robot file of it: {convert}",
    "xacro": "is a xacro file; expand it and make a robot file of it: xacro {file} > {urdf}, then {convert}",
    "srdf": "names groups of joints of a URDF, for its conversion: {convert} --srdf {file} --group NAME",
    "mujoco": "is a model of MuJoCo, which is not read; if there is a URDF of the robot: {convert}",
    "sdf": "is an SDF, which is not read; if there is a URDF of the robot: {convert}",
    "mat": "is a file of MATLAB; write a table there, writetable(t, '{csv}'), then see {look}",
    "bag": "is a ROS bag; make a CSV file of it, rostopic echo -b {file} -p /joint_states > {csv}, then see "
    "{look}",
    "mcap": "is a bag of ROS 2; make a CSV file of it, with PlotJuggler or, while ros2 bag play plays it, by "
    "ros2 topic echo --csv /joint_states > {csv}, then see {look}",
    "parquet": "is a Parquet file; make a CSV file of it, as to_csv of pandas does, then see {look}",
    "npy": "is an array of NumPy; make a CSV file of it, numpy.savetxt('{csv}', numpy.load('{file}'), "
    "delimiter=','), then see {look}",
    "xlsx": "is a spreadsheet; save it as CSV, then see {look}",
}
"""Description of each foreign format, with advice."""

SENTENCES["db3"] = SENTENCES["mcap"]

UNREADABLE = {
    "png": "PNG image",
    "jpeg": "JPEG image",
    "pdf": "PDF document",
    "gzip": "gzip archive",
    "zip": "ZIP archive",
    "binary": "binary file",
}
"""Nouns for foreign formats that cannot be converted either."""


@contextmanager
def recognizing_other_formats(path: str | os.PathLike[str]) -> Iterator[None]:
    """Replace an InputError within this context if the file is one of another program.

    Raises:
        InputError: with the format of the file, and the command for it.
    """
    try:
        yield
    except InputError:
        refuse_other_formats(path)
        raise


def refuse_other_formats(path: str | os.PathLike[str]) -> None:
    """Refuse a file in a known format of another program.

    Raises:
        InputError: with the format of the file, and the command for it.
    """
    name = os.fspath(path)
    if noun := unreadable(name):
        raise InputError.one(f"is a {noun}; expected text", name) from None
    sentence = SENTENCES.get(_recognize_format(name))
    if sentence is None:
        return
    stem = PurePath(name).name.split(".")[0] or "arm"
    urdf = shlex.quote(name if name.lower().endswith(".urdf") else f"{stem}.urdf")
    csv = shlex.quote(f"{stem}.csv")
    message = sentence.format(
        file=shlex.quote(name),
        csv=csv,
        urdf=urdf,
        convert=f"vsacli import-urdf {urdf} -o {shlex.quote(f'{stem}.yaml')}",
        look=f"vsacli info {csv}",
    )
    raise InputError.one(message, name) from None


def unreadable(path: str | os.PathLike[str]) -> str:
    """Return what a file is that no command reads, such as `PNG image`; empty for other files."""
    return UNREADABLE.get(_recognize_format(os.fspath(path)), "")


def _recognize_format(name: str) -> str:
    """Return the format by the content, or else by the ending; empty if unknown."""
    ending = PurePath(name).suffix.lower().removeprefix(".")
    try:
        place = place_of(name)
        if not os.path.isfile(place):  # opening a pipe would block
            return ""
        with open(place, "rb") as file:
            beginning = file.read(BEGINNING_BYTES)
    except (OSError, ValueError):
        return ""  # reported before
    by_content = next(
        (format_name for signature, format_name in SIGNATURES.items() if beginning.startswith(signature)), ""
    )
    by_name = ENDINGS.get(ending, ending)
    if by_content:  # spreadsheets and the like are ZIP archives
        return by_name if by_content == "zip" and by_name in SENTENCES else by_content
    text = beginning.decode("latin-1").lstrip("\ufeffï»¿ \t\r\n")
    if text.startswith("<"):
        return _recognize_xml(text, ending)
    if by_name in SENTENCES:
        return by_name if b"\0" in beginning else ""
    return "" if beginning.startswith((HDF5_SIGNATURE, *UTF16_MARKS)) else _binary_if_nul_bytes(beginning)


def _binary_if_nul_bytes(beginning: bytes) -> str:
    """Return `binary` for a first line with many NUL bytes; other lines of a damaged table may have some."""
    first = beginning.partition(b"\n")[0]
    return "binary" if len(first) <= 3 * first.count(0) > 0 else ""


def _recognize_xml(text: str, ending: str) -> str:
    tag = _ROOT_TAG.search(_COMMENT.sub("", text))
    root = tag[1] if tag else ""
    if root != "robot":
        return root
    return ending if ending in ("xacro", "srdf") else "urdf"
