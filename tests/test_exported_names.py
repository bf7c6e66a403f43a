"""The names that users import from `vsacli`: where they are, what they cost, what the pages use."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import vsacli

REPOSITORY = Path(__file__).parents[1]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]


def imported_for_types(module: ModuleType) -> list[ast.ImportFrom]:
    assert module.__file__ is not None
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    assert ast.unparse(block.test) == "TYPE_CHECKING"
    return [node for node in block.body if isinstance(node, ast.ImportFrom)]


def test_every_name_is_found_where_the_table_says() -> None:
    for name in set(vsacli.__all__) - {"__version__"}:
        thing = getattr(vsacli, name)
        assert isinstance(thing, ModuleType) or thing.__name__ == name


def test_rooms_list_what_they_import_for_type_checkers_and_the_package_offers_all_of_it() -> None:
    offered = set()
    for star in imported_for_types(vsacli):
        room = importlib.import_module(str(star.module))
        imported = [alias.name for node in imported_for_types(room) for alias in node.names]
        assert sorted(imported) == sorted(room.__all__) == dir(room)
        offered.update(imported)
    assert sorted(offered) == vsacli.__all__ == dir(vsacli)


def test_no_name_hides_behind_a_module() -> None:
    """A module of a room would take the place of a function of that name once it is imported."""
    for star in imported_for_types(vsacli):
        room = importlib.import_module(str(star.module))
        modules = {path.stem for path in Path(str(room.__file__)).parent.iterdir()}
        assert {name for name in room.__all__ if name in modules} <= {"laws", "mechanisms"}


def test_other_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="module 'vsacli' has no attribute 'Servo'"):
        _ = vsacli.Servo
    assert not hasattr(vsacli, "__path__of__")


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, vsacli; dir(vsacli); sys.exit(' '.join({'numpy', 'h5py', 'yaml'} & set(sys.modules)))"
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert outcome.stderr.strip() == ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_examples_import_from_the_package_itself(page: Path) -> None:
    for block in re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        for node in ast.walk(ast.parse(block)):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            strays = [name for name in names if name.startswith("vsacli.")]
            assert strays == [], f"{page.name}: {strays}"


def test_every_name_is_on_the_page() -> None:
    page = (REPOSITORY / "docs" / "python.md").read_text(encoding="utf-8")
    listed = re.findall(r"^- `(\w+)", page.partition("## Every name")[2], re.M)
    assert sorted(listed) == sorted(set(vsacli.__all__) - {"__version__"})


INNER = re.compile(r"^ *from (vsacli\.[\w.]+) import (?:\(([^)]*)\)|(.*))$", re.MULTILINE)


def test_tests_import_from_the_package_what_it_offers() -> None:
    """They hold for users then, and survive a move of the definition. Oracles import records alone."""
    offered = set(vsacli.__all__) - {"laws", "mechanisms"}
    inner = [
        f"{path.relative_to(REPOSITORY)}: {module}.{name}"
        for path in (REPOSITORY / "tests").rglob("*.py")
        if path.name != "goldens.py" and path.parent.name != "oracles"
        for module, several, one in INNER.findall(path.read_text(encoding="utf-8"))
        for name in offered.intersection(re.findall(r"\w+", several or one))
        if getattr(importlib.import_module(module), name, None) is getattr(vsacli, name)
    ]
    assert inner == []
