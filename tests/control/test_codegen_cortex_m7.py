"""Generated code on the processor of many controllers: compiled for a Cortex-M7, and run by QEMU."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import reachable
from samples.cortex_m7 import COMPILER, PROCESSOR, link, run
from samples.cortex_m7.instructions import taken
from samples.generated_code import STRICT, compile_c, write_files
from samples.marks import needs
from samples.shipped import shipped_robot

from vsacli import Robot
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.control.codegen.scalar import PRECISIONS

pytestmark = [
    pytest.mark.slow,
    needs(COMPILER, "gcc-arm-none-eabi"),
    needs("qemu-system-arm", "qemu-system-arm"),
]

ROBOTS: dict[str, Robot] = {
    "3R": shipped_robot("vsa_3r"),
    "measured": shipped_robot("measured_1r"),
    "mixed": shipped_robot("mixed_3r"),
}

WARNINGS = (*STRICT, "-Wconversion", "-Wdouble-promotion")


@pytest.mark.cases(1)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize(
    ("name", "patterns", "optimization"),
    [
        ("3R", (), "-O2"),
        ("3R", ("joints.*.link.mass", "joints.*.spring.k"), "-Os"),
        ("measured", (), "-Os"),
        ("mixed", (), "-O2"),
    ],
)
def test_it_compiles_without_a_warning_and_passes_its_own_test(
    name: str, patterns: Sequence[str], optimization: str, precision: str, tmp_path: Path
) -> None:
    robot = ROBOTS[name]
    prefix = prefix_of(robot)
    write_files(generate(robot, precision, patterns=patterns), tmp_path)
    flags = (*PROCESSOR, *WARNINGS, optimization)
    compile_c(tmp_path, *flags, "-c", f"{prefix}.c", compiler=COMPILER)
    compile_c(tmp_path, *PROCESSOR, *STRICT, "-c", f"{prefix}_test.c", compiler=COMPILER)
    done = run(link(tmp_path, f"{prefix}.o", f"{prefix}_test.o"))
    assert (done.stdout, done.returncode) == ("all values agree\n", 0), done.stderr


def test_a_processor_that_finds_another_number_says_so(tmp_path: Path) -> None:
    robot = ROBOTS["3R"]
    write_files(generate(robot), tmp_path)
    source = tmp_path / "vsa_3r.c"
    source.write_text(source.read_text().replace("* 9.81", "* 9.82"))
    done = run(link(tmp_path, "vsa_3r.c", "vsa_3r_test.c"))
    assert "values differ" in done.stdout
    assert done.returncode != 0


def test_single_precision_takes_nothing_from_the_library_for_doubles(tmp_path: Path) -> None:
    """Functions whose names do not end with f, and helpers of the compiler for what a processor lacks."""
    robot = ROBOTS["measured"]
    write_files(generate(robot, "float"), tmp_path)
    single = [*PROCESSOR[:2], "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard", "-O1"]
    compile_c(tmp_path, *single, "-S", "measured_1r.c", "-o", "robot.s", compiler=COMPILER)
    called = {
        line.split()[1] for line in (tmp_path / "robot.s").read_text().splitlines() if line.startswith("\tb")
    }
    assert not [name for name in called if name.startswith(("__aeabi_d", "__aeabi_f2d"))]


def test_loops_end_as_soon_in_single_precision(tmp_path: Path) -> None:
    """Tolerances of double precision are out of reach there: loops would run to their bounds."""
    robot = ROBOTS["measured"]
    chosen = reachable(robot)[:20]
    counted = {}
    for precision in PRECISIONS:
        folder = tmp_path / precision
        folder.mkdir()
        write_files(generate(robot, precision), folder)
        compile_c(folder, *PROCESSOR, "-O1", "-c", "measured_1r.c", compiler=COMPILER)
        counted[precision], _ = taken(folder, "measured_1r", chosen)
    assert np.all(counted["float"] < 1.2 * counted["double"])
