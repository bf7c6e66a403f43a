"""Files that are no documents, or mean harm: one clear line each, soon, and never another exception."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples.hostile import YAML, damaged, fuzz

from vsacli import InputError, load_robot, load_trajectory
from vsacli.documents.source import HDF5_SIGNATURE, MAX_DOCUMENT_BYTES, check_input_file

pytestmark = pytest.mark.usefixtures("own_folder")

ROOT = Path(__file__).parents[2]
EXAMPLE = (ROOT / "robots" / "rp_2.yaml").read_text()
TRAJECTORY = (ROOT / "trajectories" / "rp_2.yaml").read_text()


def only_problem(path):
    with pytest.raises(InputError) as caught:
        load_robot(path)
    (line,) = str(caught.value).splitlines()
    return line


def test_a_missing_file_with_its_neighbor():
    Path("vsa_3r.yaml").touch()
    assert only_problem("vsa-3r.yaml") == "vsa-3r.yaml: no such file; did you mean 'vsa_3r.yaml'?"


def test_a_missing_file_without_a_neighbor():
    assert only_problem("robot.yaml") == "robot.yaml: no such file"


def test_a_missing_folder():
    assert (
        only_problem("none/robot.yaml") == "none/robot.yaml: no such file; there is no folder 'none' either"
    )


def test_a_directory():
    assert only_problem(".") == ".: is a folder; give the name of a file in it"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_not_waited_for():
    os.mkfifo("pipe.yaml")
    assert only_problem("pipe.yaml") == "pipe.yaml: is not a regular file (a device, pipe or socket)"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="the system has no /dev/zero")
def test_a_device():
    assert only_problem("/dev/zero") == "/dev/zero: is not a regular file (a device, pipe or socket)"


def test_a_file_that_may_not_be_read(monkeypatch):
    Path("locked.yaml").write_text(EXAMPLE)

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("builtins.open", refuse)  # file modes do not stop an administrator
    assert only_problem("locked.yaml") == "locked.yaml: cannot be read: Permission denied"


def test_a_path_with_a_nul():
    assert only_problem("a\0b") == "a\\x00b: the path holds a NUL character"


@pytest.mark.parametrize("content", ["", " \n\n"])
def test_an_empty_file(content):
    Path("empty.yaml").write_text(content)
    assert only_problem("empty.yaml") == (
        "empty.yaml: is empty; expected a YAML file that begins with `format: vsacli-robot/1`"
    )


def test_200_megabytes_are_refused_by_their_size():
    with open("noise.yaml", "wb") as file:
        file.write(b"#" * 4096)
        file.truncate(200_000_000)
    expected = "noise.yaml: the file has 200,000,000 bytes, more than the 1,000,000 allowed here"
    assert only_problem("noise.yaml") == expected


@pytest.mark.parametrize("size", [2000, 2_000_000])
def test_a_result_in_place_of_a_robot(size):
    Path("result.h5").write_bytes(HDF5_SIGNATURE + bytes(size))
    assert only_problem("result.h5") == "result.h5: is an HDF5 file, such as a result; expected text"


def test_the_largest_document():
    content = EXAMPLE.encode()
    Path("large.yaml").write_bytes(content + b"#" * (MAX_DOCUMENT_BYTES - len(content)))
    assert load_robot("large.yaml").name == "rp-2"
    with open("large.yaml", "ab") as file:
        file.write(b"#")
    assert "more than the 1,000,000" in only_problem("large.yaml")


def test_a_file_that_grows_while_it_is_read(monkeypatch):
    Path("grown.yaml").write_bytes(b"#" * (MAX_DOCUMENT_BYTES + 1))
    monkeypatch.setattr(
        "vsacli.documents.source.check_input_file", lambda path, _: check_input_file(path, 10**9)
    )
    assert "more than the 1,000,000" in only_problem("grown.yaml")


def test_bytes_that_are_no_text():
    Path("latin.yaml").write_bytes("name: x\ndescription: Gerät".encode("latin-1"))
    message = "byte 0xe4 is not valid UTF-8; save the file as UTF-8"
    assert only_problem("latin.yaml") == f"latin.yaml:2: {message}"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 3000 + "]" * 3000, "nested more than 20 levels deep"),
        ("[" * 3000, "nested more than 20 levels deep"),
        ("{a: " * 3000, "nested more than 20 levels deep"),
        ("- " * 3000, "nested more than 20 levels deep"),
        ("? " * 3000, "nested more than 20 levels deep"),
        (
            "a: &a [x, x]\n" + "".join(f"a{i}: &a [{'*a, ' * 9}*a]\n" for i in range(100)),
            "more than 100,000 keys",
        ),
        ("[" + "1, " * 300_000 + "]", "more than 100,000 keys"),
        ("a: " + "'" * 900_001, "scanning a quoted scalar"),
        ("a" * 900_000, "expected a YAML file that begins with"),
        ("\x7fELF\x02\x01", "the character U+007F is not allowed in YAML; is this a text file?"),
    ],
    ids=lambda value: value[:12],
)
def test_a_text_that_would_cost_too_much_is_refused_at_its_line(text, problem):
    Path("bad.yaml").write_text(text)
    line = only_problem("bad.yaml")
    assert line.startswith("bad.yaml:")
    assert problem in line
    assert len(line) < 200


def test_python_objects_are_never_made():
    Path("evil.yaml").write_text(EXAMPLE + "evil: !!python/object/apply:os.mkdir [made]\n")
    with pytest.raises(
        InputError, match=r"^evil.yaml:\d+: the tag '!!python/object/apply:os.mkdir' is not allowed"
    ):
        load_robot("evil.yaml")
    assert not Path("made").exists()


def test_many_wrong_keys_of_great_length_are_cut_short():
    Path("long.yaml").write_text("".join(f"{'k' * 5000}{i}: 1\n" for i in range(190)))
    with pytest.raises(InputError) as caught:
        load_robot("long.yaml")
    assert len(caught.value.problems) <= 51
    assert len(str(caught.value)) < 10_000


def problems_of(load, name):
    try:
        load(name)
    except InputError as error:
        return error.problems
    return ()


@pytest.mark.slow
@fuzz(150)
@given(st.binary(max_size=300) | damaged(EXAMPLE, YAML).map(str.encode))
def test_any_robot_is_read_or_refused(content):
    Path("fuzz.yaml").write_bytes(content)
    assert all(problem.file == "fuzz.yaml" for problem in problems_of(load_robot, "fuzz.yaml"))


@pytest.mark.slow
@fuzz(150)
@given(damaged(TRAJECTORY, YAML).map(str.encode))
def test_any_trajectory_is_read_or_refused(content):
    robot = load_robot(ROOT / "robots" / "rp_2.yaml")
    Path("fuzz.yaml").write_bytes(content)
    problems = problems_of(lambda name: load_trajectory(name, robot), "fuzz.yaml")
    assert all(problem.file == "fuzz.yaml" for problem in problems)
