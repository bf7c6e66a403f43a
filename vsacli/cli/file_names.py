"""Names of files and folders on the command line, which shells complete."""

from __future__ import annotations

from typing import TYPE_CHECKING

from click.types import StringParamType

if TYPE_CHECKING:
    import click
    from click.shell_completion import CompletionItem


class NameType(StringParamType):
    """A name that shells complete; unlike `click.Path` it leaves to commands what is wrong on the disk."""

    def __init__(self, name: str, completion: str) -> None:
        self.name = name
        self.completion = completion

    def shell_complete(
        self, _context: click.Context, _parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Leave it to the shell, which knows how to complete names of this kind."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type=self.completion)]


FILE = NameType("file", "file")
FOLDER = NameType("folder", "dir")
