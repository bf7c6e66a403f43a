"""Files of other programs where one of ours is expected: what each is, and which command leads on from it."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath

from vsacli.base.errors import InputError
from vsacli.base.streams import place_of

BEGINNING_BYTES = 4096
"""Enough to find the first tag behind a declaration and a licence."""

_ROOT_TAG = re.compile(r"<\s*([A-Za-z][\w.-]*)")
_COMMENT = re.compile(r"<!--.*?(-->|\Z)", re.DOTALL)

SIGNATURES = {
    b"MATLAB ": "mat",
    b"#ROSBAG": "bag",
    b"\x89MCAP": "mcap",
    b"SQLite format 3": "db3",
    b"PAR1": "parquet",
    b"\x93NUMPY": "npy",
}
"""How files begin, with the ending that their names should have."""

ENDINGS = {"xls": "xlsx", "ods": "xlsx", "npz": "npy", "mjb": "mujoco"}
"""Endings that mean the same as others here."""

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
    "npy": "is an array of NumPy; make a CSV file of it, as numpy.savetxt does, then see {look}",
    "xlsx": "is a spreadsheet; save it as CSV, then see {look}",
}
"""What each is, and what to do."""

SENTENCES["db3"] = SENTENCES["mcap"]


@contextmanager
def recognising_other_formats(path: str | os.PathLike[str]) -> Iterator[None]:
    """Within this context, a file that cannot be read is looked at: whether it is one of another program.

    Raises:
        InputError: what it is and which command leads on, in place of what is wrong with it.
    """
    try:
        yield
    except InputError:
        refuse_other_formats(path)
        raise


def refuse_other_formats(path: str | os.PathLike[str]) -> None:
    """Refuse a file if it is known to be one of another program.

    Raises:
        InputError: what it is, and which command leads on.
    """
    name = os.fspath(path)
    sentence = SENTENCES.get(_format(name))
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


def _format(name: str) -> str:
    """The format by the content, or else by the ending; empty if that says nothing."""
    ending = PurePath(name).suffix.lower().removeprefix(".")
    try:
        place = place_of(name)
        if not os.path.isfile(place):  # opening a pipe would wait
            return ""
        with open(place, "rb") as file:
            beginning = file.read(BEGINNING_BYTES)
    except (OSError, ValueError):
        return ""  # which was said already
    for signature, known in SIGNATURES.items():
        if beginning.startswith(signature):
            return known
    text = beginning.decode("latin-1").lstrip("\ufeffï»¿ \t\r\n")
    if text.startswith("<"):
        return _of_xml(text, ending)
    return ENDINGS.get(ending, ending) if b"\0" in beginning else ""


def _of_xml(text: str, ending: str) -> str:
    tag = _ROOT_TAG.search(_COMMENT.sub("", text))
    root = tag[1] if tag else ""
    if root != "robot":
        return root
    return ending if ending in ("xacro", "srdf") else "urdf"
