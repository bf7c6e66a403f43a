"""Texts for users are in standard terms: no phrase of the old dialect comes back."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import click
import command_pages
import pytest
from samples.sources import PACKAGE, SOURCES, contents

from vsacli import Flag
from vsacli.base.simulation_variables import SIMULATION_VARIABLES
from vsacli.base.variables import VARIABLES
from vsacli.cli.console import Exit
from vsacli.cli.main import vsacli as group
from vsacli.files.file_kinds import DOCUMENTS
from vsacli.studies.sweeps.columns import KEPT

REPOSITORY = Path(__file__).parents[1]

PHRASES = re.compile(
    r"\b("
    + "|".join(
        (
            *(r"mend(s|ed|ing)?", r"remed(y|ies)", "astray", "strayed", "untold", "misfits?", "doubtful"),
            *("alike", r"heed(s|ed)?", r"numbers of (a|the) robot", "left open", r"comes? along"),
            *(r"ask(s|ed|ing)? for", "so many", "likewise", "by itself", "is none", "beside"),
            *(r"takes? back", "taken back", "reachable", r"corridors?", "what computes", "other value in"),
            *(r"colour\w*", r"behaviour\w*", r"neighbour\w*", r"(milli|centi)?metres?"),
            *(r"centres?", r"catalogues?", r"\w*optimis\w*", r"\w*minimis\w*", "labelled", "licence"),
        )
    )
    + r")\b",
    re.IGNORECASE,
)
"""Phrases of which a reader has to guess the meaning, and British spellings."""

NAMES = re.compile(r"`[^`]*`|(?<=\()[\w./#-]+(?=\))|[\w.-]+\.(py|md|yaml|csv|h5)\b|\bmargin\.reachable\b")
"""Parts of texts that are names: code, targets of links, files."""

OF_REPORTS = (
    *("identification/identification_report.py", "sizing/sizing_report.py", "sweeps/summary.py"),
    *("sensitivities/sensitivity_report.py", "measured/agreement.py", "search/optimum.py"),
)
"""Reports of studies, exempt until they have their new form."""

EXEMPT = {
    PACKAGE / "base" / "renamed.py",  # lists the old names
    *(PACKAGE / "studies" / name for name in OF_REPORTS),
}

MOST_IN_PAGES = 1
"""Occurrences allowed in all pages together: the glossary of the code explains an identifier, corridor."""


def found(text: str) -> list[str]:
    """Return the phrases in a text, each with the words around it."""
    prose = NAMES.sub(lambda name: " " * len(name[0]), text)
    return [prose[max(0, each.start() - 40) : each.end() + 40] for each in PHRASES.finditer(prose)]


def every_command(command: click.Command, name: str = "vsacli") -> Iterator[tuple[str, click.Command]]:
    yield name, command
    if isinstance(command, click.Group):
        for word in sorted(command.commands):
            yield from every_command(command.commands[word], f"{name} {word}")


COMMANDS = dict(every_command(group))


@pytest.mark.parametrize(
    "text", ["Alike springs.", "It asks for 3 N m.", "its corridor", "a colour", "minimise it", "two metres"]
)
def test_a_phrase_is_found(text: str) -> None:
    assert found(text)
    assert not found("an `alike` color in [words](alike.md), `asks for`, besides, parameters")


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_in_standard_terms(name: str) -> None:
    help_text = command_pages.command_help(name.split()[1:])
    assert help_text.startswith("Usage")
    assert found(" ".join(help_text.split())) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_each_option_stands_alone(name: str) -> None:
    for option in COMMANDS[name].params:
        if isinstance(option, click.Option):
            assert option.help is not None
            assert not re.match(r"(Of|In which|What|How|Where|These|Which|Such)\b", option.help), option.help
            assert "by default" not in option.help, "click shows the default: show_default"
            assert option.help.endswith("."), option.help


def strings(content: object) -> Iterator[str]:
    match content:
        case str():
            yield content
        case dict():
            for value in content.values():
                yield from strings(value)
        case list():
            for value in content:
                yield from strings(value)


@pytest.mark.parametrize("kind", DOCUMENTS)
def test_schemas_are_in_standard_terms(kind: str) -> None:
    schema = json.loads(json.dumps(DOCUMENTS[kind].schema()))
    assert [phrase for text in strings(schema) for phrase in found(text)] == []


def test_declared_words_are_in_standard_terms() -> None:
    texts = (
        *(each.long_name for each in (*VARIABLES.values(), *SIMULATION_VARIABLES.values(), *KEPT.values())),
        *(each.meaning for each in (*Flag, *Exit)),
    )
    assert [phrase for text in texts for phrase in found(text)] == []


def test_messages_are_in_standard_terms() -> None:
    assert all(path.is_file() for path in EXEMPT)
    assert [
        f"{path.relative_to(REPOSITORY)}:{line}: {phrase}"
        for path in SOURCES
        if path not in EXEMPT
        for text, line in contents(path).literals
        if " " in text
        for phrase in found(text)
    ] == []


def test_pages_are_in_standard_terms() -> None:
    pages = [REPOSITORY / "README.md", *(REPOSITORY / "docs").rglob("*.md")]
    code = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
    phrases = [
        f"{page.relative_to(REPOSITORY)}: {phrase}"
        for page in pages
        if page.name != "renamed.md"
        for phrase in found(code.sub("", page.read_text(encoding="utf-8")))
    ]
    assert len(phrases) <= MOST_IN_PAGES, "\n".join(phrases)
