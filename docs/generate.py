"""Write the generated parts of README.md and of the pages in docs/ from the code.

Without options it rewrites the parts and draws the images, which needs Chromium and some minutes.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from command_pages import command_pages, command_table
from field_tables import record_sections, table, variant_sections
from noise_study import table_rows
from page_examples import renewed
from page_images import draw_images
from python_names import public_names

from vsacli import inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.actuator import Actuator
from vsacli.actuators.kinds import ACTUATORS
from vsacli.actuators.laws import LAWS
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.actuators.serial import Serial
from vsacli.base.flags import FLAG_BITS
from vsacli.base.renamed import RENAMINGS
from vsacli.base.signals import COMMANDED, POSITION, WRENCHES
from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.variables import VARIABLES, Variable
from vsacli.base.wrench import WRENCH_NAMES, wrench_columns
from vsacli.cli.console import Exit
from vsacli.control.poles import PolesFile
from vsacli.documents.columns_file import ColumnSource
from vsacli.documents.fields import declared_fields
from vsacli.documents.plausibility import Rule
from vsacli.files.examples import Example, examples, examples_root, opening_comment
from vsacli.robot.file import RobotFile
from vsacli.robot.plausibility import ROBOT_RULES
from vsacli.studies.sizing import CatalogMotor
from vsacli.studies.sweeps.columns import KEPT
from vsacli.studies.sweeps.study_file import StudyFile
from vsacli.trajectory.file import trajectory_file_class
from vsacli.trajectory.plausibility import TRAJECTORY_RULES

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
"""Pages written by hand, with generated parts."""

ROBOT = ROOT / "robots" / "vsa_3r.yaml"

MECHANISM_WORDS = {
    "awas": "AwAS arm",
    "lever": "lever",
    "variable_ratio": "variable ratio",
    "maccepa": "MACCEPA",
    "potential": "energy formula",
    "cam": "cam disk",
    "shifted_cams": "shifted cams",
}
"""Mechanisms of serial actuators in words."""

END = "<!-- end of generated part -->"
PART = re.compile(rf"(<!-- generated: (?P<name>\S+) -->\n).*?({END})", re.DOTALL)


def exit_codes() -> str:
    """Table of the exit codes."""
    return table(("exit code", "meaning"), ((str(code.value), code.meaning) for code in Exit))


def robot_fields() -> str:
    """Fields of a robot file but for its springs."""
    return record_sections(RobotFile, elsewhere=[LAWS])


def spring_fields() -> str:
    """Fields of each spring law."""
    return variant_sections(LAWS)


def trajectory_fields() -> str:
    """Fields of a trajectory file."""
    cls = trajectory_file_class(frozenset(COMMANDED), rigid=False)
    as_wrench = declared_fields(cls)[WRENCHES][0].kind.records
    return record_sections(cls, [as_wrench])


def csv_columns() -> str:
    """Columns of a recorded trajectory."""
    return table(
        ("column", "unit", "needed"),
        [("`time`", str(VARIABLES["time"].quantity), "yes"), *_signal_columns(), *_wrench_columns()],
    )


def _signal_columns() -> Iterator[tuple[str, str, str]]:
    for signal in (POSITION, *COMMANDED.values()):
        for name in signal.names:
            of_device = f"for a {signal.device} that is commanded" if signal.device else "yes"
            needed = of_device if name == signal.names[0] else "no"
            yield f"`<joint>.{name}`", str(VARIABLES[name].quantity), needed


def _wrench_columns() -> Iterator[tuple[str, str, str]]:
    for name in WRENCH_NAMES:
        columns = " ".join(f"`{column}`" for column in wrench_columns(name))
        columns += f"; of several tools `<tool>.{wrench_columns(name)[0]}` ..."
        needed = "for a wrench" if name == WRENCH_NAMES[0] else "no"
        yield columns, str(VARIABLES[name].quantity), needed


def column_fields() -> str:
    """What may be said of a column."""
    return record_sections(ColumnSource)


def pole_fields() -> str:
    """Fields of a poles file."""
    return record_sections(PolesFile)


def study_fields() -> str:
    """Fields of a study file."""
    return record_sections(StudyFile)


def motor_columns() -> str:
    """Columns of a catalog of motors."""
    rows = record_sections(CatalogMotor)
    return rows.replace("| key | value |", "| column | value |", 1)


def study_columns() -> str:
    """What a study keeps of each run."""
    return table(
        ("column", "dimensions", "unit", "meaning"),
        (
            (f"`{each.name}`", ", ".join(("run", *each.dims)), str(each.quantity), each.long_name)
            for each in KEPT.values()
        ),
    )


def robot_rules() -> str:
    """Table of the plausibility rules of robots."""
    return _rules(ROBOT_RULES)


def trajectory_rules() -> str:
    """What numbers of a trajectory are held against."""
    return _rules(TRAJECTORY_RULES)


def _rules(rules: Iterable[Rule[Any]]) -> str:
    return table(
        ("value", "keys", "size", "passes", "reason"),
        ((rule.name, rule.fields, rule.size, _bounds(rule.low, rule.high), rule.reason) for rule in rules),
    )


def _bounds(low: float, high: float) -> str:
    if math.isinf(high):
        return f"from {low:g}"
    return f"below {high:g}" if low <= 0 else f"{low:g} to {high:g}"


def variables() -> str:
    """Variables of a result file."""
    return _variables(VARIABLES)


def simulation_variables() -> str:
    """Variables of a simulation file that a result does not have."""
    return _variables({name: each for name, each in SIMULATION_VARIABLES.items() if name not in VARIABLES})


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


def flags(variable: str = "flags") -> str:
    """Bits of a variable of flags."""
    return table(
        ("bit", "name", "meaning"),
        ((str(flag.value), f"`{flag.label}`", flag.meaning) for flag in FLAG_BITS[variable]),
    )


def robots() -> str:
    """The robots that come along: a table, and what each file says about its numbers."""
    shown = examples()
    rows = table(("robot", "joints", "actuators", "trajectories"), map(_robot_row, shown))
    return "\n".join([rows, *(f"## {example.name}\n\n{_origin(example)}\n" for example in shown)])


def _robot_row(example: Example) -> tuple[str, ...]:
    joints = example.robot.joints
    kinds = Counter(_actuator_words(joint.actuator) for joint in joints)
    return (
        _link(example.path),
        "".join("R" if joint.is_revolute else "P" for joint in joints),
        ", ".join(f"{count} {kind}" for kind, count in kinds.items()),
        ", ".join(_link(each.path) for each in example.trajectories),
    )


def _actuator_words(actuator: Actuator) -> str:
    """The kind, and of a serial actuator its mechanism instead, with a link to its section."""
    if not isinstance(actuator, Serial):
        return ACTUATORS.name_of(type(actuator))
    name = MECHANISMS.name_of(type(actuator.mechanism))
    return f"[{MECHANISM_WORDS[name]}](serial.md#{name})"


def _link(path: Path) -> str:
    """To an example, wherever the package is installed."""
    return f"[{path.stem}](../{path.relative_to(examples_root()).as_posix()})"


def _origin(example: Example) -> str:
    """The comment of its file, without the sentences that are the same in many files."""
    comment = re.sub(r" ?(Numbers are SI;|Mechanism and law are)[^.]*\.", "", opening_comment(example.path))
    return textwrap.fill(comment, 118, break_long_words=False, break_on_hyphens=False)


def stiffness_cost() -> str:
    """What the motors of the 3R arm do for the same motion at a low, a rising and a high stiffness."""
    return table(
        (
            "stiffness, N m/rad",
            "peak motor torque",
            "co-contraction, rms",
            "spent",
            "recovered",
            "work",
            "in the springs",
        ),
        map(_cost, ("rest_to_rest_soft", "rest_to_rest", "rest_to_rest_stiff")),
    )


def _cost(name: str) -> tuple[str, ...]:
    robot = load_robot(ROBOT)
    result = inverse_dynamics(robot, load_trajectory(ROOT / "trajectories" / f"{name}.yaml", robot))
    energies = [joint.energy for joint in result.report.joints]
    spent, recovered = (sum(each) for each in zip(*((e.spent, e.recovered) for e in energies), strict=True))
    low, high = (result.elastic_energy[step].sum() for step in (0, -1))
    base = result.report.joints[0]
    return (
        " to ".join(f"{value:.0f}" for value in dict.fromkeys((base.commanded_min, base.commanded_max))),
        f"{max(base.peak_tau_motor):.1f} N m",
        f"{base.energy.co_contraction:.1f} N m",
        f"{spent:.1f} J",
        f"{recovered:.1f} J",
        f"{spent - recovered:.1f} J",
        " to ".join(f"{energy:.1f}" for energy in (low, high)) + " J",
    )


def renamings() -> str:
    """Names that changed before version 0.1."""
    return table(
        ("kind", "now", "before", "place"),
        ((each.kind, f"`{each.new}`", f"`{each.old}`", each.place) for each in RENAMINGS),
    )


def noise_study() -> str:
    """Error of the fourth derivative over rate and noise of a record."""
    header = ("samples", "noise", "knots", "unreliable at each end", "error of d4q, `lsq`", "`interpolate`")
    return table(header, table_rows())


PARTS: dict[str, Callable[[], str]] = {
    "noise-study": noise_study,
    "commands": command_table,
    "exit-codes": exit_codes,
    "robot-fields": robot_fields,
    "spring-fields": spring_fields,
    "trajectory-fields": trajectory_fields,
    "csv-columns": csv_columns,
    "column-fields": column_fields,
    "pole-fields": pole_fields,
    "study-fields": study_fields,
    "motor-columns": motor_columns,
    "study-columns": study_columns,
    "robot-rules": robot_rules,
    "trajectory-rules": trajectory_rules,
    "stiffness-cost": stiffness_cost,
    "simulation-variables": simulation_variables,
    "robots": robots,
    "public-names": public_names,
    "variables": variables,
    "flags": flags,
    "tool-flags": lambda: flags("tool_flags"),
    "renamings": renamings,
    **{f"commands/{name}": page for name, page in command_pages().items()},
}


WHOLE_PAGES = {ROOT / "docs" / f"{name}.md": name for name in PARTS if "/" in name}
"""Pages that are one generated part, and its name."""


def regenerated(page: str) -> str:
    """Return the text of a page with its generated parts made anew."""
    return PART.sub(lambda part: f"{part[1]}\n{PARTS[part['name']]()}\n{END}", page)


def text_of(page: Path) -> str:
    """Return the text that a page should have."""
    if page in WHOLE_PAGES:
        return regenerated(f"<!-- generated: {WHOLE_PAGES[page]} -->\n{END}\n")
    return regenerated(page.read_text(encoding="utf-8"))


def stale(pages: Iterable[Path] = PAGES) -> list[Path]:
    """Return the pages that differ from what the code says, and whole pages that are missing or surplus."""
    current = {
        page: page.read_text(encoding="utf-8") if page.exists() else "" for page in (*pages, *WHOLE_PAGES)
    }
    return [page for page, text in current.items() if text != text_of(page)] + _surplus()


def _surplus() -> list[Path]:
    """Return the pages in folders of whole pages that are none of these."""
    return sorted({file for page in WHOLE_PAGES for file in page.parent.glob("*.md")} - WHOLE_PAGES.keys())


def write_texts(pages: Iterable[Path]) -> None:
    """Write the generated texts of these pages, or of all; delete whole pages that are surplus."""
    for page in [page.resolve() for page in pages] or (*PAGES, *WHOLE_PAGES):
        page.write_text(text_of(page), encoding="utf-8")
    for page in _surplus():
        page.unlink()


def main() -> int:
    """Run the script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    one = parser.add_mutually_exclusive_group()
    one.add_argument(
        "--check", action="store_true", help="only say which pages are stale; exit code 1 if any is"
    )
    one.add_argument("--texts", action="store_true", help="leave the images as they are")
    one.add_argument("--examples", action="store_true", help="renew the outputs that pages show")
    parser.add_argument("pages", nargs="*", type=Path, help="pages, of all if none")
    chosen = parser.parse_args()
    if chosen.check:
        for page in (outdated := stale()):
            print(f"{page}: generated parts are stale; run python docs/generate.py", file=sys.stderr)
        return 1 if outdated else 0
    if chosen.examples:
        for page in chosen.pages or PAGES:
            page.write_text(renewed(page), encoding="utf-8")
        return 0
    write_texts(chosen.pages)
    if not chosen.texts:
        draw_images(PAGES)
    return 0


if __name__ == "__main__":
    sys.exit(main())
