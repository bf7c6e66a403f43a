"""Write the generated parts of README.md and of the pages in docs/ from the code.

python docs/generate.py            rewrites the parts and draws the images
python docs/generate.py --check    changes nothing; exit code 1 if a part is stale
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import chdir
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from field_tables import record_sections, table, variant_sections

from vsacli.cli.exit_codes import Exit
from vsacli.cli.main import vsacli
from vsacli.columns import JOINT_SIGNALS
from vsacli.control.poles import PolesFile
from vsacli.flags import Flag
from vsacli.robot import Robot
from vsacli.simulation.variables import SIMULATION_VARIABLES
from vsacli.springs import LAWS
from vsacli.trajectory_file import TrajectoryFile
from vsacli.variables import VARIABLES, Variable
from vsacli.wrench import WRENCH_NAMES, wrench_columns

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
ROBOT = ROOT / "robots" / "vsa_3r.yaml"
IMAGES = ROOT / "docs" / "images"

SHOWN = (
    "rest_to_rest-motion.png",
    "rest_to_rest-motor-torque.png",
    "rest_to_rest_soft-rest_to_rest_stiff-compare.png",
)
"""Figures on the pages."""

HELP_WIDTH = 80
END = "<!-- end of generated part -->"
PART = re.compile(rf"(<!-- generated: (?P<name>\S+) -->\n).*?({END})", re.DOTALL)


def commands() -> str:
    """The help of `vsacli` and of each command."""
    names = ["", *vsacli.commands]
    return "\n".join(
        f"## `{f'vsacli {name}'.strip()}`\n\n```text\n{command_help(name)}```\n" for name in names
    )


def command_help(name: str) -> str:
    """What `vsacli NAME --help` prints."""
    arguments = [name, "--help"] if name else ["--help"]
    return CliRunner().invoke(vsacli, arguments, prog_name="vsacli", terminal_width=HELP_WIDTH).stdout


def exit_codes() -> str:
    """Table of the exit codes."""
    return table(("exit code", "meaning"), ((str(code.value), code.meaning) for code in Exit))


def robot_fields() -> str:
    """Fields of a robot file but for its springs."""
    return record_sections(Robot, elsewhere=[LAWS])


def spring_fields() -> str:
    """Fields of each spring law."""
    return variant_sections(LAWS)


def trajectory_fields() -> str:
    """Fields of a trajectory file."""
    return record_sections(TrajectoryFile)


def csv_columns() -> str:
    """Columns of a recorded trajectory."""
    return table(
        ("column", "unit", "needed"),
        [("`time`", str(VARIABLES["time"].quantity), "yes"), *_signal_columns(), *_wrench_columns()],
    )


def _signal_columns() -> Iterator[tuple[str, str, str]]:
    for signal in JOINT_SIGNALS:
        for name in signal.names:
            needed = "yes" if name == signal.names[0] else "no"
            yield f"`<joint>.{name}`", str(VARIABLES[name].quantity), needed


def _wrench_columns() -> Iterator[tuple[str, str, str]]:
    for name in WRENCH_NAMES:
        columns = " ".join(f"`{column}`" for column in wrench_columns(name))
        needed = "for a wrench" if name == WRENCH_NAMES[0] else "no"
        yield columns, str(VARIABLES[name].quantity), needed


def pole_fields() -> str:
    """Fields of a poles file."""
    return record_sections(PolesFile)


def variables() -> str:
    """Variables of a result file."""
    return _variables(VARIABLES)


def simulation_variables() -> str:
    """Variables of a simulation file."""
    return _variables(SIMULATION_VARIABLES)


def _variables(declared: Mapping[str, Variable]) -> str:
    return table(
        ("variable", "dimensions", "unit", "meaning", "equation"),
        (
            (
                f"`{name}`",
                ", ".join(("time", *variable.dims)),
                str(variable.quantity),
                variable.long_name,
                variable.equation,
            )
            for name, variable in declared.items()
        ),
    )


def flags() -> str:
    """Bits of the variable `flags`."""
    return table(
        ("bit", "name", "meaning"), ((str(flag.value), f"`{flag.label}`", flag.meaning) for flag in Flag)
    )


PARTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "exit-codes": exit_codes,
    "robot-fields": robot_fields,
    "spring-fields": spring_fields,
    "trajectory-fields": trajectory_fields,
    "csv-columns": csv_columns,
    "pole-fields": pole_fields,
    "simulation-variables": simulation_variables,
    "variables": variables,
    "flags": flags,
}


def regenerated(page: str) -> str:
    """The text of a page with its generated parts made anew."""
    return PART.sub(lambda part: f"{part[1]}\n{PARTS[part['name']]()}\n{END}", page)


def stale(pages: Iterable[Path] = PAGES) -> list[Path]:
    """The pages that are not what the code says."""
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    return [page for page, text in texts.items() if text != regenerated(text)]


def draw_images() -> None:
    """Draw the pictures of the pages with the tool itself."""
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for name in ("rest_to_rest", "rest_to_rest_soft", "rest_to_rest_stiff"):
            _run("invdyn", ROBOT, ROOT / "trajectories" / f"{name}.yaml", "-o", f"{name}.h5")
        _run("plot", "rest_to_rest.h5")
        _run("plot", "rest_to_rest_soft.h5", "rest_to_rest_stiff.h5")
        for name in SHOWN:
            shutil.copy(name, IMAGES)


def _run(*arguments: Any) -> None:
    outcome = CliRunner().invoke(vsacli, [str(argument) for argument in arguments], standalone_mode=False)
    if outcome.exception:
        raise outcome.exception


def main() -> int:
    """Run the script; returns its exit code."""
    if "--check" in sys.argv[1:]:
        for page in (outdated := stale()):
            print(f"{page}: generated parts are stale; run python docs/generate.py", file=sys.stderr)
        return 1 if outdated else 0
    for page in PAGES:
        page.write_text(regenerated(page.read_text(encoding="utf-8")), encoding="utf-8")
    draw_images()
    return 0


if __name__ == "__main__":
    sys.exit(main())
