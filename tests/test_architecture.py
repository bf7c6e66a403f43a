"""The house: which module may import which, and what happens, and does not, at import."""

from __future__ import annotations

import ast
import graphlib
import re
from collections import Counter
from pathlib import Path

import numpy as np
from samples.call_paths import returns, visited
from samples.command_line import REST_TO_REST, ROBOT
from samples.defined_names import defined_twice, share_of_empty_words
from samples.python_processes import run_python
from samples.sources import PACKAGE, SOURCES, contents, parsed

from vsacli import load_robot, load_trajectory, motor_torques

REPOSITORY = Path(__file__).parents[1]
ROW = re.compile(r"^\| `(?P<entry>\w+(?:\.\w+)?)` \| .+ \|$", re.MULTILINE)

HOMES = {
    "yaml": "documents",
    "h5py": "results.store",
    "matplotlib": "results.plots",
    "click": "cli",
    "pyarrow": "results.exports",
    "jinja2": "results.pages",
}
"""Libraries that only one folder may import."""

HEAVY = ("numpy", "scipy", "matplotlib", "h5py", "hashlib")

MOST_FILES, MOST_STATEMENTS, MOST_SHARED_NAMES, MOST_HEADLESS = 480, 54_500, 19, 1
"""How many files and statements of Python the package has at most, names of files that several folders
have, and docstrings that begin without a verb or a noun. A change that needs more raises these, with its
reason in its message; one that needs less lowers them."""

MOST_CLASS_NAMES_TWICE, MOST_FUNCTION_NAMES_TWICE, LARGEST_SHARE_OF_EMPTY_WORDS = 8, 40, 0.007
"""How many names of classes and functions several modules define at most, private ones included, commands
not; and the share of names that are a word without content. Like the counts above, they are lowered, or
raised with a reason."""

MOST_RETURNS = {"robot file": 106, "trajectory file": 915, "block": 251, "recording": 238}
"""How often reading a robot or a trajectory, and computing a block, come back to a module they have left."""

HEADLESS = re.compile(
    r"(and|as|at|but|by|each|for|from|has|how|if|in|is|its?|of|on|so|than|that|those|to|what|when|where|which|while"
    r"|who|whom|whose|with)\b",
    re.IGNORECASE,
)
"""Words with which no docstring begins: it names its subject, or says what to do."""

PAGE = (REPOSITORY / "docs" / "contributing.md").read_text(encoding="utf-8")
ENTRIES = ROW.findall(PAGE.partition("\n## Packages\n")[2].partition("\n## ")[0])
"""What lies in the package, from the rooms at the bottom to the entrances."""

ROOMS = [entry for entry in ENTRIES if "." not in entry]
TESTS = Path(__file__).parent


def part_of(source: Path) -> str:
    """Name of the module or subpackage directly below `vsacli` in which a source file lies."""
    return source.relative_to(PACKAGE).with_suffix("").parts[0]


def is_folder(source: Path) -> bool:
    """Whether a source file only opens a folder."""
    return source.name == "__init__.py"


def dotted(source: Path) -> str:
    """Name of a source file's module, without `vsacli.`."""
    return ".".join(source.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


def lines_run_at_import(source: Path) -> set[int]:
    """Lines where the statements begin that run when a module is imported."""
    waiting: list[ast.AST] = [parsed(source)]
    lines = set()
    while waiting:
        for child in ast.iter_child_nodes(waiting.pop()):
            for_types_only = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
            if isinstance(child, ast.stmt) and not isinstance(child, ast.FunctionDef) and not for_types_only:
                lines.add(child.lineno)
                waiting.append(child)
    return lines


def test_the_table_of_rooms_is_what_lies_in_the_package() -> None:
    there = {entry.name for entry in PACKAGE.iterdir()} - {"__pycache__", "robots", "trajectories"}
    assert len(ENTRIES) == len(set(ENTRIES))
    assert set(ENTRIES) == there


def test_a_room_imports_only_from_rows_above_its_own() -> None:
    strays = []
    for source in SOURCES:
        room = part_of(source)
        for name, line in contents(source).imports if room in ROOMS else ():
            library, _, rest = name.partition(".")
            if library == "vsacli":
                target = rest.partition(".")[0]
                if ROOMS.index(target) > ROOMS.index(room):
                    strays.append(f"{source}:{line}: {room} may not import {name}")
    assert strays == []


def test_modules_form_no_circle() -> None:
    """Of imports anywhere, inside functions and for types only as well."""
    modules = {dotted(source): source for source in SOURCES}
    graph: dict[str, set[str]] = {}
    for module, source in modules.items():
        named = {
            name.removeprefix("vsacli.") for name, _ in contents(source).imports if name.startswith("vsacli.")
        }
        graph[module] = {name for name in named if name in modules and not is_folder(modules[name])}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError


def test_the_package_grows_only_on_purpose() -> None:
    names = Counter(source.name for source in SOURCES if not is_folder(source))
    assert len(SOURCES) <= MOST_FILES
    statements = (isinstance(node, ast.stmt) for source in SOURCES for node in ast.walk(parsed(source)))
    assert sum(statements) <= MOST_STATEMENTS, "raise MOST_STATEMENTS if the package is to grow"
    assert sum(count > 1 for count in names.values()) <= MOST_SHARED_NAMES


def test_names_are_defined_once_and_say_something() -> None:
    assert len(defined_twice(ast.ClassDef)) <= MOST_CLASS_NAMES_TWICE
    assert len(defined_twice(ast.FunctionDef)) <= MOST_FUNCTION_NAMES_TWICE
    assert share_of_empty_words() <= LARGEST_SHARE_OF_EMPTY_WORDS


def test_data_seldom_return_to_a_module_that_they_have_left(tmp_path: Path) -> None:
    robot = load_robot(ROBOT)
    trajectory = load_trajectory(REST_TO_REST, robot)
    times = np.linspace(0, trajectory.duration, 401)
    motion, log = trajectory.at(times), tmp_path / "log.csv"
    columns = [f"{name}.{quantity}" for quantity in ("q", "stiffness") for name in robot.joint_names]
    rows = np.column_stack([times, motion.q, motion.commanded["stiffness"]])
    np.savetxt(log, rows, delimiter=",", header=",".join(["time", *columns]), comments="")
    stages = {
        "robot file": lambda: load_robot(ROBOT),
        "trajectory file": lambda: load_trajectory(REST_TO_REST, robot),
        "block": lambda: motor_torques(robot, trajectory.block(0, 100)),
        "recording": lambda: load_trajectory(log, robot),
    }
    counts = {name: returns(visited(stage)) for name, stage in stages.items()}
    assert {name: count for name, count in counts.items() if count > MOST_RETURNS[name]} == {}


def test_docstrings_begin_with_their_subject() -> None:
    headless = [text for source in SOURCES for text in contents(source).docstrings if HEADLESS.match(text)]
    assert len(headless) <= MOST_HEADLESS


def test_libraries_stay_at_home() -> None:
    strays = [
        f"{source}:{line}: {name}"
        for source in SOURCES
        for name, line in contents(source).imports
        if not dotted(source).startswith(HOMES.get(name.partition(".")[0], ""))
        # SciPy imports its parts, which take long, when they are used; `import scipy` alone costs nothing.
        or (name.startswith("scipy.") and line in lines_run_at_import(source))
    ]
    assert strays == []


def test_only_the_command_line_prints() -> None:
    strays = [
        f"{source}:{line}: {name}"
        for source in SOURCES
        if part_of(source) != "cli"
        for name, line in contents(source).talk
    ]
    assert strays == []


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys; from vsacli.cli.main import run; code = run(['invdyn', '--help']);"
        f" sys.exit(str([name for name in {HEAVY} if name in sys.modules]) if code == 0 else 'help failed')"
    )
    outcome = run_python(code, tmp_path)
    assert outcome.stderr.strip() == "[]"
    assert "Usage: vsacli invdyn" in outcome.stdout


def test_importing_everything_does_nothing_else(tmp_path: Path) -> None:
    modules = [
        ".".join(source.relative_to(PACKAGE.parent).with_suffix("").parts)
        for source in SOURCES
        if part_of(source) != "__main__"
    ]
    code = f"""
import importlib, signal, sys
handler = signal.getsignal(signal.SIGINT)
for module in {modules}:
    importlib.import_module(module)
import numpy
assert "matplotlib.pyplot" not in sys.modules
assert numpy.geterr() == dict(divide="warn", over="warn", under="ignore", invalid="warn")
assert signal.getsignal(signal.SIGINT) is handler
"""
    outcome = run_python(code, tmp_path)
    assert (outcome.returncode, outcome.stdout, outcome.stderr) == (0, "", "")
    assert not list(tmp_path.iterdir())


def quick_tests(source: Path) -> list[str]:
    """Tests of a file that run without being asked for, some of their cases at least."""
    return [
        node.name
        for node in ast.parse(source.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and "pytest.mark.slow" not in map(ast.unparse, node.decorator_list)
    ]


def test_every_room_has_a_folder_of_tests_of_which_some_are_quick() -> None:
    folders = {path.name for path in TESTS.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    rooms = {entry for entry in ROOMS if (PACKAGE / entry).is_dir()}
    assert folders == rooms | {"benchmarks", "oracles", "samples"}
    assert [room for room in rooms if not any(map(quick_tests, (TESTS / room).glob("test_*.py")))] == []


def test_oracles_know_nothing_of_what_they_judge() -> None:
    """Oracles take robots and arrays, and compute by themselves."""
    known = ("vsacli.base.arrays", "vsacli.robot.joint", "vsacli.robot.model")
    strays = [
        f"{source}:{line}: {name}"
        for source in sorted((TESTS / "oracles").glob("*.py"))
        for name, line in contents(source).imports
        if name.startswith("vsacli") and name not in known
    ]
    assert strays == []


def test_test_files_share_what_lies_in_samples() -> None:
    of_tests = re.compile(r"^\s*(?:from|import) (?:\.|test_|conftest).*", re.MULTILINE)
    strays = [
        f"{source}: {line}"
        for source in sorted(TESTS.rglob("*.py"))
        for line in of_tests.findall(source.read_text(encoding="utf-8"))
    ]
    assert strays == []
