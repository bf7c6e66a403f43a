"""Generated projects as they reach a controller: files, warnings, self-test, what the object code needs."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import clear, commands, expected_of, motion_of, with_springs
from samples.command_line import REPOSITORY
from samples.generated_code import STRICT, compile_c, compiled_robot, write_files
from samples.marks import COMPILERS, needs, needs_compiler, slow, slow_but
from samples.robots import random_robot
from samples.shipped import shipped_robot, shipped_run
from samples.springs import SPRINGS

from vsacli import Flag, InputError, Robot, __version__, motor_torques
from vsacli.base.variables import VARIABLES
from vsacli.control.codegen.project import Project, generate, prefix_of
from vsacli.control.codegen.robot_functions import inverse_dynamics_function

ROBOTS: dict[str, Robot] = {
    "one joint": random_robot("R", seed=1),
    "3R": shipped_robot("vsa_3r"),
    "prismatic": shipped_robot("rp_2"),
    "mixed": shipped_robot("mixed_3r"),
    **{law: with_springs(law) for law in SPRINGS},
}

BUNDLED = sorted(
    str(path.relative_to(REPOSITORY / "robots").with_suffix(""))
    for path in (REPOSITORY / "robots").rglob("*.yaml")
)

SANITIZED = ("one joint", "prismatic", "mixed", "sinh", "table")

MATH = {
    *("sqrt", "cbrt", "exp", "expm1", "log", "log1p", "pow", "hypot", "fabs", "copysign"),
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh"),
}


@cache
def project(name: str, precision: str = "double") -> Project:
    return generate(ROBOTS[name], precision)


def self_test(name: str, folder: Path, *flags: str, compiler: str, precision: str = "double") -> str:
    """Compile with every warning on, and run; what the program says."""
    write_files(project(name, precision), folder)
    prefix = prefix_of(ROBOTS[name])
    sources = (f"{prefix}.c", f"{prefix}_test.c")
    compile_c(folder, *STRICT, *flags, *sources, "-o", "self_test", "-lm", compiler=compiler)
    done = subprocess.run(["./self_test"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""
    return done.stdout


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", slow_but({"3R", "mixed", "sinh"}, ROBOTS))
@pytest.mark.parametrize(
    "compiler", [pytest.param(name, marks=needs(name, name)) for name in ("gcc", "clang")]
)
def test_it_compiles_without_a_warning_and_passes_its_own_test(
    compiler: str, name: str, tmp_path: Path
) -> None:
    assert self_test(name, tmp_path, compiler=compiler) == "all values agree\n"


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.parametrize("name", slow_but({"one joint"}, SANITIZED))
def test_no_undefined_behavior(name: str, tmp_path: Path) -> None:
    flags = ("-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
    assert self_test(name, tmp_path, *flags, compiler=COMPILERS[0]) == "all values agree\n"


@pytest.mark.slow
@pytest.mark.cases(1)
@needs_compiler
@pytest.mark.parametrize("name", ["3R", "mixed", "sinh", "table", "four_bar"])
def test_single_precision_compiles_without_a_warning_and_passes(name: str, tmp_path: Path) -> None:
    assert self_test(name, tmp_path, compiler=COMPILERS[-1], precision="float") == "all values agree\n"


@pytest.mark.slow
@pytest.mark.cases(3)
@needs_compiler
@pytest.mark.parametrize("path", BUNDLED)
@pytest.mark.parametrize("precision", ["double", "float"])
def test_every_bundled_robot_passes_its_own_test_in_both_precisions(
    path: str, precision: str, tmp_path: Path
) -> None:
    robot = shipped_robot(path)
    write_files(generate(robot, precision), tmp_path)
    sources = [f"{prefix_of(robot)}{ending}.c" for ending in ("", "_test")]
    compile_c(tmp_path, *STRICT, *sources, "-o", "self_test", "-lm")
    done = subprocess.run(["./self_test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("all values agree\n", "")


@pytest.mark.slow
@needs_compiler
def test_a_potential_in_single_precision_is_feasible_along_its_trajectory(tmp_path: Path) -> None:
    """Tolerances of the continuation lay below single precision: 908 of 1001 samples were infeasible."""
    robot, trajectory = shipped_run("sliding_anchor_1r", "sliding_anchor_1r")
    motion = trajectory.at(np.linspace(0, trajectory.duration, 101))
    expected = motor_torques(robot, motion)
    function = inverse_dynamics_function(robot)
    command = {
        name: motion.variables()[name] for _, given in function.arguments for name in given.layout.shapes
    }
    found, returned = compiled_robot(tmp_path / "c", robot, [function], "float")(function, command)
    assert not np.any(returned)
    # 2e-3 of the peak, as the self-test has it; 2e-4 is seen.
    error = np.abs(found["tau_motor"] - expected.tau_motor).max()
    assert error <= 2e-3 * np.abs(expected.tau_motor).max()


@pytest.mark.cases(3)
@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", ["3R", *map(slow, ("mixed", "sinh", "table", "four_bar"))])
def test_no_number_changes_its_type_unsaid(name: str, precision: str, tmp_path: Path) -> None:
    write_files(project(name, precision), tmp_path)
    flags = ("-Wconversion", "-Wdouble-promotion", "-fsyntax-only")
    compile_c(tmp_path, *STRICT, *flags, f"{prefix_of(ROBOTS[name])}.c")


@pytest.mark.slow
@needs_compiler
def test_the_self_test_notices_a_wrong_number(tmp_path: Path) -> None:
    write_files(project("prismatic"), tmp_path)
    source = tmp_path / "rp_2.c"
    text = source.read_text()
    assert "* 9.81" in text
    source.write_text(text.replace("* 9.81", "* 9.82"))
    done = subprocess.run(["make", "-s", "test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert re.search(r"^case 0: link_torques: tau_e\[0\] is \S+, expected \S+$", done.stdout, re.MULTILINE)
    assert re.search(r"^\d+ values differ$", done.stdout, re.MULTILINE)


@pytest.mark.slow
@needs_compiler
@needs("make", "make")
def test_the_makefile(tmp_path: Path) -> None:
    write_files(project("prismatic"), tmp_path)
    before = {path.name for path in tmp_path.iterdir()}
    make = ["make", f"CC={COMPILERS[0]}", "CFLAGS=-std=c99 -O2 -Wall -Wextra -pedantic -Werror"]
    for target in ([], ["test"]):
        done = subprocess.run([*make, *target], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert "all values agree" in done.stdout
    subprocess.run([*make, "clean"], cwd=tmp_path, capture_output=True, check=True)
    assert {path.name for path in tmp_path.iterdir()} == before


@needs_compiler
@needs("nm", "binutils")
@pytest.mark.parametrize("name", [slow("3R"), "mixed", slow("sinh")])
def test_the_code_keeps_nothing_and_calls_nothing_but_the_math_library(name: str, tmp_path: Path) -> None:
    write_files(project(name), tmp_path)
    prefix = prefix_of(ROBOTS[name])
    compile_c(tmp_path, *STRICT, "-O1", "-c", f"{prefix}.c", "-o", "robot.o")
    listed = subprocess.run(
        ["nm", "robot.o"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines()]
    called = {symbol for kind, symbol in symbols if kind == "U"}
    assert called - {"_GLOBAL_OFFSET_TABLE_", "memcpy", "memset", "sincos"} <= MATH
    assert {kind for kind, _ in symbols} <= set("UTtrR"), "no data that changes"
    assert all(symbol.startswith(f"{prefix}_") for kind, symbol in symbols if kind == "T")


@pytest.mark.parametrize("name", ["3R", slow("table")])
def test_every_loop_is_bounded_by_a_constant(name: str) -> None:
    source = project(name).files[f"{prefix_of(ROBOTS[name])}.c"]
    assert not re.search(
        r"\b(goto|do|malloc|calloc|free|printf|static (?!const|inline|void subroutine_))\b", source
    )
    assert all(re.search(r"_step < \d+ && ", head) for head in re.findall(r"for \(.*\)", source))
    assert set(re.findall(r"while \(.*\)", source)) <= {"while (low < high)"}, "halving of a table"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["table", "four_bar"])
def test_nothing_of_a_spring_stands_in_the_code_twice(name: str) -> None:
    source = project(name).files[f"{prefix_of(ROBOTS[name])}.c"]
    arrays = [entries.split(", ") for entries in re.findall(r"^static const .*\{(.*)\};$", source, re.M)]
    assert arrays
    for number, array in enumerate(arrays):
        others = (" ".join(["", *other, ""]) for other in arrays[:number] + arrays[number + 1 :])
        assert not any(" ".join(["", *array, ""]) in other for other in others)
    subroutines = re.findall(r"^static void (subroutine_\d+)\(.*?^}$", source, re.M | re.S)
    bodies = re.findall(r"^static void subroutine_\d+(\(.*?^})$", source, re.M | re.S)
    assert len(set(bodies)) == len(bodies) == len(subroutines) > 0
    assert all(len(re.findall(rf"\b{name}\(", source)) > 2 for name in subroutines), "one is the definition"


@needs_compiler
@pytest.mark.parametrize(
    "compiler",
    [
        pytest.param("g++", marks=needs("g++", "g++")),
        pytest.param("clang++", marks=needs("clang++", "clang")),
    ],
)
def test_the_header_is_also_one_of_cpp(compiler: str, tmp_path: Path) -> None:
    write_files(project("3R"), tmp_path)
    (tmp_path / "main.cpp").write_text(
        '#include "vsa_3r.h"\n#include "vsa_3r.h"\n'
        "int main() { vsa_3r_motion motion = {}; vsa_3r_torques torques;\n"
        "  vsa_3r_link_torques(&motion, &torques); return torques.tau_e[0] != torques.tau_e[0]; }\n"
    )
    compile_c(tmp_path, *STRICT, "-c", "vsa_3r.c", "-o", "robot.o")
    warnings = ("-Wall", "-Wextra", "-pedantic", "-Werror")
    compile_c(tmp_path, *warnings, "main.cpp", "robot.o", "-lm", compiler=compiler)


def test_the_header_says_what_it_is_about() -> None:
    header = project("prismatic").files["rp_2.h"]
    for flag in Flag:
        assert f"RP_2_{flag.name} = {flag.value}, /* {flag.meaning} */" in header
    for name in ("q", "d4q", "tau_e", "tau_motor", "ddtheta"):
        quantity = VARIABLES[name].quantity
        units = " or ".join(quantity.unit(joint_type) for joint_type in ("revolute", "prismatic"))
        assert re.search(rf"double {name}\[.*/\* .*{re.escape(units)} \*/", header), name
    prose = " ".join(header.split())
    assert "0 arm (revolute, antagonistic), 1 slide (prismatic, antagonistic)" in prose
    assert "nothing acts on the end effector" in prose
    assert max(map(len, header.splitlines())) <= 160


def test_the_files() -> None:
    sources = {"vsa_3r.c", "vsa_3r.h", "vsa_3r_test.c", "vsa_3r_gpu.cu"}
    modules, build = {"vsa_3r.py", "vsa_3r_gpu.py"}, {"Makefile", "CMakeLists.txt", "README.md"}
    assert set(project("3R").files) == sources | modules | build
    readme = project("3R").files["README.md"]
    assert "vsa_3r_inverse_dynamics(&" in readme or "vsa_3r_inverse_dynamics(command" in readme
    assert "0 base, 1 shoulder, 2 elbow" in readme


def test_the_header_says_of_which_robot_and_by_which_vsacli() -> None:
    robot = shipped_robot("vsa_3r")
    digest = hashlib.sha256(Path(robot.sources[0].path).read_bytes()).hexdigest()
    header = generate(robot).files["vsa_3r.h"]
    assert f'#define VSA_3R_ROBOT_SHA256 "{digest}"\n' in header
    assert f'#define VSA_3R_VERSION "{__version__}"\n' in header
    assert "ROBOT_SHA256" not in project("one joint").files[f"{prefix_of(ROBOTS['one joint'])}.h"]


@pytest.mark.slow
@needs("cmake", "cmake")
def test_cmake_builds_the_library_and_its_test(tmp_path: Path) -> None:
    write_files(project("prismatic"), tmp_path)
    for command in (
        ("cmake", "-B", "build", f"-DCMAKE_C_COMPILER={COMPILERS[0]}"),
        ("cmake", "--build", "build"),
        ("ctest", "--test-dir", "build", "--output-on-failure"),
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed" in done.stdout


@needs_compiler
@needs("make", "make")
def test_make_size_says_what_code_and_stack_take(tmp_path: Path) -> None:
    write_files(project("prismatic"), tmp_path)
    done = subprocess.run(
        ["make", "size", "CC=gcc"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert re.search(r"^ *\d+\s+0\s+0\s", done, re.MULTILINE), "text, and nothing that changes"
    assert re.search(r"rp_2_inverse_dynamics\t\d+$", done, re.MULTILINE)


def test_code_without_loops() -> None:
    made = generate(ROBOTS["3R"], loops=False)
    assert "for (" not in made.files["vsa_3r.c"]
    assert made.files["vsa_3r.c"] == project("3R").files["vsa_3r.c"]
    one_loops = with_springs("sinh")  # the springs of the first joint are alike, those of the second are not
    name = one_loops.joint_names[1]
    with pytest.raises(InputError, match=f"{name} of two sinh is solved by iteration; only pairs of"):
        generate(one_loops, loops=False)


def test_a_project_is_the_same_each_time() -> None:
    assert generate(ROBOTS["mixed"]).files == project("mixed").files


def test_what_cannot_be_generated_is_left_out_with_the_reason() -> None:
    mixed = project("mixed")
    assert not any("feedback_linearization(" in text for text in mixed.files.values())
    (omitted,) = mixed.omitted
    assert omitted.startswith(
        "no feedback_linearization: feedback linearization needs springs at all joints or at none"
    )
    assert omitted in re.sub(r"\\(.)", r"\1", mixed.files["README.md"])


FLOAT_BOUND = {
    "vsa_3r": 1e-6,
    "rp_2": 1e-6,
    "lwr_7r_vsa": 1e-6,
    "measured_1r": 1e-5,
    "qbmove_arm_gazebo": 1e-5,
}
"""Of a variable's peak, margin above 10 %: a rounding is 6e-8, and the recursion adds some tens of them.

Springs whose stiffness grows tenfold over their range multiply what rounding does to a deflection by as much.
"""


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.parametrize("name", slow_but({"rp_2"}, FLOAT_BOUND))
def test_accuracy_in_single_precision(name: str, tmp_path: Path) -> None:
    robot = shipped_robot(name)
    function, command = inverse_dynamics_function(robot), commands(robot, 200, seed=9)
    command = {key: values.astype(np.float32).astype(float) for key, values in command.items()}
    found, _ = compiled_robot(tmp_path / "c", robot, [function], "float")(function, command)
    block = motor_torques(robot, motion_of(command))
    with np.errstate(invalid="ignore"):
        margin = (block.stiffness - block.stiffness_min) / block.stiffness - 0.1 + 1e-3
    for key, values in found.items():
        expected = expected_of(block, key)
        chosen = clear(margin, expected.shape) & np.isfinite(expected)
        if key == "flags":
            np.testing.assert_array_equal(values[chosen], expected[chosen])
            continue
        scale = np.abs(expected[chosen]).max(initial=0.0)
        np.testing.assert_allclose(
            values[chosen], expected[chosen], rtol=0, atol=FLOAT_BOUND[name] * scale, err_msg=key
        )


@needs_compiler
def test_files_of_two_robots_do_not_go_together(tmp_path: Path) -> None:
    """As a process leaves them that is killed between two names in a folder that was there."""
    for name, robot in (("new", ROBOTS["3R"]), ("old", replace(ROBOTS["3R"], gravity=(0.0, 0.0, -1.62)))):
        (tmp_path / name).mkdir()
        for file, text in generate(robot).files.items():
            (tmp_path / name / file).write_text(text, encoding="utf-8")
    for name in ("vsa_3r.c", "vsa_3r_test.c"):
        shutil.copy(tmp_path / "old" / name, tmp_path / "new" / name)
        command = ["cc", "-std=c99", "-fsyntax-only", name]
        done = subprocess.run(command, cwd=tmp_path / "new", capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert "this file and vsa_3r.h were not written together: generate both again" in done.stderr


@pytest.mark.slow
def test_a_function_of_too_many_operations_is_left_out(most_operations: Callable[..., None]) -> None:
    """The limit is not reached by any arm; the recursion of this one takes 4300, feedback 6300."""
    most_operations(5800, 5000)
    made = generate(shipped_robot("lwr_7r_vsa"))
    assert made.omitted == ["no feedback_linearization: a step takes more than 5000 operations"]
    assert "feedback_linearization" not in made.files["lwr_7r_vsa.h"]
    readme = made.files["README.md"]
    assert "There is no feedback\\_linearization: a step takes more than 5000 operations.\n" in readme


def test_a_robot_of_too_many_operations_is_refused(most_operations: Callable[..., None]) -> None:
    most_operations(1000, 100)
    match = "no C code can be made of lwr-7r-vsa: link_torques: a step takes more than 100 operations"
    with pytest.raises(InputError, match=match):
        generate(shipped_robot("lwr_7r_vsa"))
