"""README and docs: what they show is what the program does."""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import generate
import h5py
import page_examples
import pytest
from page_examples import PRINTED, blocks, commands, comparable, copy_examples, run_shell
from samples.command_line import installed
from samples.forked_commands import ONE_PROCESS, command_server
from samples.marks import slow
from site_parts import contents

import vsacli
from vsacli.analysis.self_check import LADDER_BOUND, SPRING_BOUND
from vsacli.base.flags import MIN_MARGIN, SINGULAR_MARGIN
from vsacli.cli.main import vsacli as group
from vsacli.documents.source import MAX_DOCUMENT_BYTES
from vsacli.documents.tree import MAX_LEVELS, MAX_NODES

REPOSITORY = Path(__file__).parents[1]
README = REPOSITORY / "README.md"
PAGES = [README, *sorted((REPOSITORY / "docs").glob("*.md"))]
TUTORIALS = sorted((REPOSITORY / "docs" / "tutorials").glob("*.md"))
COMMANDS = [REPOSITORY / "docs" / "commands" / f"{name}.md" for name in group.commands]
FORMATS = [REPOSITORY / "docs" / "file-formats.md", *sorted((REPOSITORY / "docs").glob("formats-*.md"))]

LONG = (
    *("cli.md", "codegen.md", "damping.md", "energy.md", "figures.md", "formats-results.md"),
    *("fixing-a-motion.md", "friction.md", "gallery.md", "identification.md", "index.md", "measured.md"),
    *("models.md", "optimization.md", "performance.md", "plausibility.md", "python.md"),
    *("reading-a-verdict.md", "recorded.md", "recordings.md", "robots.md", "ros-bags.md"),
    *("README.md", "file-formats.md", "scope.md", "sensitivity.md", "serial.md"),
    *("simulation.md", "sizing.md", "studies.md", "urdf.md"),
)
"""Pages whose examples take more than half a second."""

EXIT_CODE = re.compile(r"# exit code (\d+)$")


def named(page: Path) -> str:
    return page.name


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what a clone shows."""
    copy_examples(tmp_path)
    return tmp_path


STUDY = REPOSITORY / "docs" / "recorded.md"
"""Page with the noise study, which takes longer than all other generated parts."""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a command `vsacli` that has everything imported."""
    with command_server(tmp_path_factory.mktemp("server"), ONE_PROCESS) as scripts:
        yield scripts


@pytest.mark.slow
def test_generated_parts_are_up_to_date() -> None:
    assert generate.stale(page for page in generate.PAGES if page != STUDY) == [], (
        "run python docs/generate.py"
    )


@slow
def test_the_noise_study_is_up_to_date() -> None:
    assert STUDY in generate.PAGES
    assert generate.stale([STUDY]) == [], "run python docs/generate.py"


def test_a_stale_part_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- generated: exit-codes -->\nold\n<!-- end of generated part -->\nafter\n")
    assert generate.stale([page]) == [page]
    page.write_text(generate.regenerated(page.read_text()))
    assert generate.stale([page]) == []
    assert page.read_text().startswith("before\n")
    assert "old" not in page.read_text()


def test_missing_and_surplus_pages_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, three = (tmp_path / f"{name}.md" for name in ("one", "two", "three"))
    monkeypatch.setattr(generate, "WHOLE_PAGES", {one: "exit-codes", two: "flags"})
    one.write_text(generate.text_of(one))
    three.write_text("# Three\n")
    assert generate.stale([]) == [two, three]
    generate.write_texts([two])
    assert generate.stale([]) == []
    assert not three.exists()


def test_a_stale_example_is_renewed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\nvsacli --version\n```\n\n```text\nvsacli none\n```\n\nend\n")
    assert page_examples.renewed(page) == page.read_text().replace("none", vsacli.__version__)
    page.write_text("```python\nprint(3)  # 3\nprint(4)\n```\n\n```text\n5\n```\n")
    assert page_examples.renewed(page) == page.read_text().replace("\n5", "\n4")


def test_every_part_has_its_place() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (*PAGES, *COMMANDS))
    assert {match["name"] for match in generate.PART.finditer(text)} == generate.PARTS.keys()


@pytest.mark.parametrize("page", [slow(page) if page.name in LONG else page for page in PAGES], ids=named)
def test_examples_do_what_the_page_says(page: Path, folder: Path, request: pytest.FixtureRequest) -> None:
    scripts = request.getfixturevalue("scripts") if page.name in LONG else page_examples.SCRIPTS
    printed: tuple[str, ...] = ()
    for block in blocks(page):
        if block.saved_as:
            (folder / block.saved_as).write_text(block.text)
        if block.language == "text" and printed:
            assert block.text.strip()
            assert comparable(block.text) in printed
        printed = ()
        for line in commands(block):
            outcome = run_shell(line, folder, scripts)
            expected = int(match[1]) if (match := EXIT_CODE.search(line)) else 0
            assert outcome.returncode == expected, f"{line}\n{outcome.stdout}{outcome.stderr}"
            if block.language == "sh":
                printed = comparable(outcome.stdout), comparable(outcome.stderr)
    check_python_examples(page, folder)


@slow
def test_examples_of_help_texts_work(folder: Path, scripts: Path) -> None:
    page_examples.make_files_of_other_pages(folder, scripts)
    for page in COMMANDS:
        for line in (line for block in blocks(page) for line in commands(block)):
            outcome = run_shell(line, folder, scripts)
            assert outcome.returncode == 0, f"{line}\n{outcome.stdout}{outcome.stderr}"


def check_python_examples(page: Path, folder: Path) -> None:
    """Run the Python blocks of a page; a comment behind `print` says what it prints, up to a colon.

    What is printed without a comment is one of the page's blocks of text.
    """
    code = "".join(block.text for block in blocks(page) if block.language == "python")
    if not code:
        return
    texts = [comparable(block.text) for block in blocks(page) if block.language == "text"]
    outcome = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert outcome.returncode == 0, outcome.stderr
    printed = f"{comparable(outcome.stdout)}\n"
    for comment in PRINTED.findall(code):
        expected = [comment] if comment else texts
        shown = next((text for text in expected if printed.startswith(f"{text}\n")), None)
        assert shown is not None, f"{comment!r} is not how this begins: {printed!r}"
        printed = printed.removeprefix(f"{shown}\n")
    assert printed.strip() == ""


def test_the_readme_has_one_line_for_the_main_job_and_one_for_the_tests() -> None:
    lines = [line for line in README.read_text().splitlines() if line.startswith("python3 -m venv")]
    assert ["vsacli invdyn" in line for line in lines] == [True, False]
    assert ["pytest" in line for line in lines] == [False, True]


@pytest.mark.parametrize("name", sorted(group.commands))
def test_every_command_explains_itself(name: str) -> None:
    command = group.commands[name]
    assert command.help
    assert command.short_help
    assert all(option.help for option in command.params if isinstance(option, click.Option))
    page = REPOSITORY / "docs" / "commands" / f"{name}.md"
    shown = [line for block in blocks(page) for line in commands(block)]
    assert any(line.startswith(f"vsacli {name} ") for line in shown), f"no example for {name}"


@pytest.mark.parametrize("page", [*PAGES, *COMMANDS, *TUTORIALS], ids=named)
def test_internal_links_resolve(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    targets = [target for target in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in target]
    for target in targets:
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.is_file(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(file), f"{page.name}: {target}"


def test_the_contents_list_every_page() -> None:
    """The first page lists pages, `cli` those of commands, `file-formats` those of formats."""
    docs = REPOSITORY / "docs"
    index = (docs / "index.md").read_text(encoding="utf-8")
    groups = re.findall(r"^## (.*)$", index, re.MULTILINE)
    assert groups == ["Tutorials", "How-to guides", "Reference", "Explanation", "Contributing"]
    texts = [(docs / f"{name}.md").read_text(encoding="utf-8") for name in contents.PAGES]
    listed = [f"{page}.md" for text in texts for _, page in contents.ENTRY.findall(text)]
    assert sorted(listed) == sorted(
        page.relative_to(docs).as_posix() for page in docs.rglob("*.md") if page.name != "index.md"
    )


def test_the_contents_say_what_each_page_answers() -> None:
    """In about five words, next to its title."""
    text = (REPOSITORY / "docs" / "index.md").read_text(encoding="utf-8")
    entries = re.findall(r"^- \[[^\]]+\]\(([^)]+)\)(.*)$", text, re.MULTILINE)
    assert len(entries) == len(contents.ENTRY.findall(text))
    for page, answer in entries:
        assert re.fullmatch(r": \w[^:]*(: .*)?", answer), page
        assert 3 <= len(answer.partition(": ")[2].partition(": ")[0].split()) <= 6, page


def test_the_first_pages_lead_to_what_is_not_done() -> None:
    for page, link in (
        (REPOSITORY / "README.md", "docs/scope.md"),
        (REPOSITORY / "docs" / "index.md", "scope.md"),
    ):
        assert f"({link})" in page.read_text(encoding="utf-8")


def test_exit_codes_are_listed_once() -> None:
    """Other pages link to the table."""
    assert [
        page.name for page in PAGES if re.search(r"^\|.*exit code.*\|\n\| ---", page.read_text(), re.M)
    ] == ["cli.md"]


def anchors(page: Path) -> set[str]:
    """The names that headings get where Markdown is shown."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.fixture(scope="module")
def format_pages() -> str:
    """The pages of the file formats in one text."""
    return "".join(page.read_text(encoding="utf-8") for page in FORMATS)


@pytest.fixture
def result(folder: Path) -> Path:
    """A result with steps that are infeasible and over a limit."""
    robot, trajectory = folder / "robots" / "rp_2.yaml", folder / "trajectories" / "rp_2.yaml"
    trajectory.write_text(trajectory.read_text().replace("arm: 950", "arm: 790"))
    assert installed("invdyn", robot, trajectory, "-o", "result.h5", folder=folder).returncode == 3
    return folder / "result.h5"


@pytest.mark.slow
def test_every_key_of_the_report_is_documented(result: Path, format_pages: str) -> None:
    with h5py.File(result) as file:
        report = json.loads(file["report/json"].asstr()[()])
    for key in leaves(report):
        assert f"`{key}`" in format_pages, key


def leaves(content: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Keys as the page writes them: nested ones joined by dots, those of a list or of kinds by themselves."""
    for key, value in content.items():
        match key, value:
            case "joints", [*joints]:
                yield from (leaf for joint in joints for leaf in leaves(joint))
            case "samples" | "first_time", dict():
                yield key
                yield from (kind for kind in value if not kind.endswith("_limit"))
            case "worst", dict():
                yield key
                yield from (leaf for worst in value.values() for leaf in leaves(worst))
            case _, dict():
                yield from leaves(value, f"{key}.")
            case _:
                yield f"{prefix}{key}"


@pytest.mark.slow
def test_every_attribute_and_group_of_a_result_is_documented(result: Path, format_pages: str) -> None:
    with h5py.File(result) as file:
        attributes = list(file.attrs)
        groups = [name for name, item in file.items() if isinstance(item, h5py.Group)]
    tree = next(
        block.text for block in blocks(REPOSITORY / "docs" / "formats-results.md") if block.language == "text"
    )
    assert all(f"`{name}`" in format_pages for name in attributes)
    assert sorted(groups) == ["inputs", "report"]
    assert all(f"── {name}" in tree for name in groups)


def test_the_numbers_in_the_text_are_those_of_the_code(format_pages: str) -> None:
    theory = (REPOSITORY / "docs" / "theory.md").read_text(encoding="utf-8")
    for number in (SINGULAR_MARGIN, MIN_MARGIN, SPRING_BOUND, LADDER_BOUND):
        assert f"{number:g}".replace("e-0", "e-") in theory
    assert f"{MAX_DOCUMENT_BYTES // 10**6} MB, {MAX_LEVELS} levels and {MAX_NODES:,} nodes" in format_pages


def test_every_extra_package_has_its_reason() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    table = (REPOSITORY / "docs" / "dependencies.md").read_text(encoding="utf-8")
    for requirement in (each for extra in project["optional-dependencies"].values() for each in extra):
        name = re.match(r"[\w-]+", requirement)
        assert name
        assert re.search(rf"^\| .*`{name[0]}`.* \| \w.* \|$", table, re.MULTILINE), requirement


def test_the_changelog_begins_with_this_version() -> None:
    changelog = (REPOSITORY / "docs" / "changelog.md").read_text(encoding="utf-8")
    newest = re.findall(r"^## (.*)$", changelog, re.MULTILINE)[0]
    assert re.fullmatch(rf"{re.escape(vsacli.__version__)} \((unreleased|\d{{4}}-\d\d-\d\d)\)", newest)
    assert importlib.metadata.version("vsacli") == vsacli.__version__
