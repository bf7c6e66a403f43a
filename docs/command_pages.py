"""Pages of the commands: `docs/commands/NAME.md` for each, and the table of all of them in `docs/cli.md`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import click
from click.testing import CliRunner
from field_tables import table

from vsacli.cli.main import SectionedGroup, vsacli

HELP_WIDTH = 80

GUIDES = {
    "invdyn": "[Read a verdict](reading-a-verdict.md)",
    "check-feasibility": "[Fix a motion](fixing-a-motion.md)",
    "simulate": "[Simulate a controller](simulation.md)",
    "codegen": "[Generate C code](codegen.md)",
    "sensitivity": "[Rank parameters](sensitivity.md)",
    "identify": "[Identify robot parameters](identification.md)",
    "study": "[Compute many runs](studies.md)",
    "optimize": "[Optimize stiffness and timing](optimization.md)",
    "size": "[Size motors and springs](sizing.md)",
    "plot": "[Figures](figures.md)",
    "export": "[Export](formats-results.md#export), [MuJoCo and URDF](models.md)",
    "compare": "[Compare with a recording](measured.md)",
    "new": "[A robot of your own](tutorials/first_robot.md#a-robot-of-your-own)",
    "examples": "[Bundled robots](robots.md)",
    "import-urdf": "[Convert a URDF](urdf.md)",
    "validate": "[Plausible values](plausibility.md)",
    "info": "[Descriptions](formats-json.md#description)",
    "schema": "[Complete keys in an editor](file-formats.md#in-an-editor)",
}
"""The page about the task of each command, as a link from `docs/`."""


def command_table() -> str:
    """Tables of all commands, in the sections of `vsacli --help`."""
    assert isinstance(vsacli, SectionedGroup)
    return "\n".join(f"### {title}\n\n{_rows(names)}" for title, names in vsacli.sections.items())


def _rows(names: Sequence[str]) -> str:
    return table(
        ("command", "task", "page"),
        (
            (f"[`{name}`](commands/{name}.md)", vsacli.commands[name].get_short_help_str(99), GUIDES[name])
            for name in names
        ),
    )


def command_pages() -> dict[str, partial[str]]:
    """Return a function for each command that makes its page: its help, with those of its subcommands."""
    return {name: partial(command_page, name) for name in vsacli.commands}


def command_page(name: str) -> str:
    """Return the page of a command."""
    first, *others = command_words(name, vsacli.commands[name])
    guide = GUIDES[name].replace("](", "](../")
    head = f"# `vsacli {name}`\n\nSee {guide}; [exit codes](../cli.md#exit-codes).\n"
    sections = (f"## `vsacli {' '.join(words)}`\n\n{_help_block(words)}" for words in others)
    return "\n".join([head, _help_block(first), *sections])


def command_words(name: str, command: click.Command) -> Iterator[list[str]]:
    """Yield the words to type for a command, and for each of its subcommands."""
    yield [name]
    if isinstance(command, click.Group):
        for each, subcommand in command.commands.items():
            yield from ([name, *words] for words in command_words(each, subcommand))


def _help_block(words: Sequence[str]) -> str:
    return f"```text\n{command_help(words)}```\n"


def command_help(words: Sequence[str]) -> str:
    """Return the output of `vsacli WORDS --help`."""
    arguments = [*words, "--help"]
    return CliRunner().invoke(vsacli, arguments, prog_name="vsacli", terminal_width=HELP_WIDTH).stdout
