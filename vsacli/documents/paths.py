"""Paths into files, such as `joints.elbow.actuator.spring.k`, to find and to replace values.

The words of a path are keys of mappings. An entry of a list is given by its index, from 0, or by its name;
`*` stands for all entries.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, Self, TypeVar

from vsacli.base.did_you_mean import did_you_mean, nearest
from vsacli.base.errors import InputError, InvalidRecordError, Problem
from vsacli.base.texts import on_one_line
from vsacli.documents.fields import Items, ItemsByName, PairOf, ValueKind, declared_fields, variant_inside
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_reader import read_value
from vsacli.documents.record_values import entry_names
from vsacli.documents.source import Problems
from vsacli.documents.tree import ListNode, MapNode, Node, Scope, TextNode, plain

ALL = "*"
SIDES = ("0", "1")

_Record = TypeVar("_Record", bound=DeclaredRecord)


def find(content: Any, path: str) -> Any:
    """Return the value at a path in plain data; a list of values if `*` is a word of the path.

    Args:
        content: mappings, lists, numbers and texts, as in JSON.
        path: path to a value, e.g. `joints.0.link.mass`, `joints.elbow.link.mass` or `joints.*.link.mass`.

    Raises:
        InputError: with the first word that is not found, and the nearest valid one.
    """
    return _find_from(content, path.split("."), ())


def _find_from(content: Any, words: list[str], place: tuple[str, ...]) -> Any:
    if not words:
        return content
    word, *rest = words
    if word == ALL and isinstance(content, list):
        return [_find_from(entry, rest, (*place, str(index))) for index, entry in enumerate(content)]
    entries = _entries_by_word(content)
    if word not in entries:
        raise _missing_word_error(word, entries, place)
    return _find_from(entries[word], rest, (*place, word))


def _entries_by_word(content: Any) -> dict[str, Any]:
    match content:
        case Mapping():
            return dict(content)
        case list():
            names = [str(entry.get("name", "")) if isinstance(entry, Mapping) else "" for entry in content]
            return {word: content[index] for word, index in _indices(names).items()}
    return {}


def _indices(names: Iterable[str]) -> dict[str, int]:
    """Return the index of each entry of a list, by its name, if not empty, and by the index as text."""
    numbered = list(enumerate(names))
    named = {name: index for index, name in numbered if name}
    return named | {str(index): index for index, _ in numbered}


class ReplacementError(InputError):
    """A value that cannot be replaced, with the path to it."""

    def __init__(self, problems: Iterable[Problem], path: str) -> None:
        super().__init__(problems)
        self.path = path


def _missing_word_error(word: str, valid_words: Iterable[str], place: tuple[str, ...]) -> InputError:
    """Return the error for a word that is not among the valid words at a place."""
    words = list(valid_words)
    where = f"{_dotted_path(place)} has" if place else "there is"
    names = [each for each in words if not each.isdecimal()]
    if not words:
        hint = "; it is a single value"
    elif len(words) == len(names) or nearest(word, names):
        hint = did_you_mean(word, names)
    else:  # entries of a list, by index and perhaps by name
        last = len(words) - len(names) - 1
        hint = f"; valid: {', '.join(names)}{' or ' if names else ''}0{f' to {last}' if last else ''}"
    return InputError.one(f"{where} no {word!r}{hint}")


def _dotted_path(place: Iterable[str]) -> str:
    return ".".join(place)


def declared_paths(cls: type) -> Iterator[str]:
    """Yield the paths to all fields of a record class; `*` stands for the entries of lists of records.

    Pairs of sides have none, since a path without a side changes both.
    """
    for name, (field, _) in declared_fields(cls).items():
        yield name
        place = f"{name}.{ALL}" if isinstance(field.kind, Items) else name
        for inner in field.kind.records.values():
            yield from (f"{place}.{path}" for path in declared_paths(inner))


def replace(
    record: _Record,
    path: str,
    value: Any,
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
    file: str = "",
) -> _Record:
    """Return a record of declared fields with a new value at a path; the given record is not changed.

    `Robot.replace` offers it, as in `replace(robot, "joints.elbow.actuator.spring.k", 500)`. For a pair of
    equal sides, a path without side changes both; if the sides differ, it needs 0, 1 or `*`. Every record
    along the path is constructed anew, and so checked.

    Args:
        record: record such as a robot; its undeclared fields, such as the sources of a robot, are kept.
        path: path to a declared field, or to an entry of its list.
        value: value in a form that a file can hold: number, text such as `90 deg`, list or mapping of those.
        members: name and unit variant of every joint, if the document has PerJoint values.
        exempt: for purposes of PerJoint values, the joints without a value, each with the reason.
        file: path of the document, to which paths of other files in the value are relative.

    Raises:
        InputError: the path does not exist, with the valid words; or the value is invalid, with every problem
            and the path to it.
    """
    scope = Scope(Problems(file), members or {}, exempt or {})
    return _Replacements(scope).in_record(record, [_NewValue.of(path, value)], ())


def replace_all(
    record: _Record,
    values: Mapping[str, Any],
    members: Mapping[str, str] | None = None,
    exempt: Mapping[str, Mapping[str, str]] | None = None,
    file: str = "",
) -> _Record:
    """Return a record with new values at several paths; see `replace`.

    All are replaced at once, and each record is checked once. Where that is refused, they are replaced in
    turn, and values that are refused are tried again after the others: keys that need each other, such as
    `gear_ratio` and `side` of a motor, may be given in any order.

    Raises:
        ReplacementError: the first value that is refused, though the others are replaced.
    """
    scope = Scope(Problems(file), members or {}, exempt or {})
    with suppress(InputError):
        return _Replacements(scope).in_record(record, [_NewValue.of(*each) for each in values.items()], ())
    return _replace_in_turn(record, values, scope)


def _replace_in_turn(record: _Record, values: Mapping[str, Any], scope: Scope) -> _Record:
    refused_values: dict[str, Any] = {}
    first_error = None
    for path, value in values.items():
        try:
            record = _Replacements(scope).in_record(record, [_NewValue.of(path, value)], ())
        except InputError as error:
            first_error = first_error or ReplacementError(error.problems, path)
            refused_values[path] = value
    if first_error is None:
        return record
    if len(refused_values) == len(values):
        raise first_error
    return _replace_in_turn(record, refused_values, scope)


def _node_of_value(value: Any) -> Node:
    """Return a value as if it had been read from a file; texts as if in quotes."""
    match value:
        case str():
            return TextNode(0, value, plain=False)
        case bool():
            return TextNode(0, on_one_line(value), plain=True)
        case Mapping():
            entries = {str(key): _node_of_value(entry) for key, entry in value.items()}
            return MapNode(0, entries, dict.fromkeys(entries, 0))
        case Iterable():
            return ListNode(0, tuple(map(_node_of_value, value)))
    return TextNode(0, "" if value is None else str(value), plain=True)


class _NewValue(NamedTuple):
    """A value to be replaced: the words of the rest of the path to it, and the replacement."""

    words: list[str]
    node: Node

    @classmethod
    def of(cls, path: str, value: Any) -> Self:
        """Return the change of a value at a path."""
        return cls(path.split("."), _node_of_value(value))

    @property
    def inside(self) -> _NewValue:
        """The change as seen from where the first word leads to."""
        return self._replace(words=self.words[1:])


class _Replacements(NamedTuple):
    """Replacements for values in a record, with the context of their meaning.

    Methods return a copy of their argument that contains the replacements. The place is the beginning of the
    paths, for messages. Changes of which one is inside another are refused.
    """

    scope: Scope

    def in_record(self, record: _Record, changes: Sequence[_NewValue], place: tuple[str, ...]) -> _Record:
        """Return a record with the replacements in it."""
        cls: type = type(record)
        fields = declared_fields(cls)
        variant_choice = getattr(record, getattr(cls, "unit_variant", ""), None)
        variant = variant_inside(cls, variant_choice, self.scope.variant)
        inner_replacements, contents = _Replacements(self.scope._replace(variant=variant)), {}
        for word, inner_changes in _by_first_word(changes).items():
            if word not in fields:
                raise _missing_word_error(word, fields, place)
            kind = fields[word][0].kind
            contents[word] = inner_replacements.in_value(
                kind, getattr(record, word), inner_changes, (*place, word)
            )
        try:
            return record.with_fields(contents)
        except InvalidRecordError as error:
            problems = [str(problem.in_units(variant).inside(*place)) for problem in error.fields]
            raise InputError(Problem("", 0, message) for message in problems) from None

    def in_value(
        self, kind: ValueKind, content: Any, changes: Sequence[_NewValue], place: tuple[str, ...]
    ) -> Any:
        """Return a value with the replacements in it, or the replacement itself at the end of its path."""
        words, node = changes[0]
        if not all(each.words for each in changes):
            _check_single(changes, place)
            return self._read_value(kind, node, place)
        is_named_entry = isinstance(kind, ItemsByName) and len(words) == 1 and words[0] != ALL
        if is_named_entry and isinstance(node, MapNode):
            _check_single(changes, place)
            return self._with_entry(kind, content or (), words[0], node, place)
        if content is None:
            raise InputError.one(f"there is nothing at {_dotted_path(place)}; replace it as a whole")
        if isinstance(kind, PairOf) and not any(each.words[0] in SIDES for each in changes):
            return self._in_pair(kind, content, changes, place)
        if kind.item is not None:
            return self._in_list(kind, kind.item, content, changes, place)
        if words == ["type"] and "" not in kind.records:
            reason = "the type cannot be changed alone, since each type has other keys"
            example = f"'{_dotted_path(place)}={{type: {plain(node)}, ...}}'"
            raise InputError.one(f"{_dotted_path(place)}.type: {reason}; give the whole mapping, {example}")
        if kind.records:
            return self.in_record(content, changes, place)
        raise _missing_word_error(words[0], (), place)

    def _read_value(self, kind: ValueKind, node: Node, place: tuple[str, ...]) -> Any:
        label, problems = _dotted_path(place), Problems(self.scope.problems.file)
        if kind.records and not isinstance(kind, Items | PairOf) and isinstance(node, TextNode):
            keys = dict.fromkeys(key for cls in kind.records.values() for key in declared_fields(cls))
            raise InputError.one(f"{label} is a mapping; set one of its keys: {', '.join(keys)}")
        content = read_value(kind, node, label, self.scope._replace(problems=problems))
        try:
            problems.check()
        except InputError as error:
            messages = [problem.message.removeprefix(f"{label}: ") for problem in error.problems]
            raise InputError(Problem("", 0, f"{label}: {message}") for message in messages) from None
        return content

    def _in_pair(
        self, kind: PairOf, content: Any, changes: Sequence[_NewValue], place: tuple[str, ...]
    ) -> Any:
        """Return both sides of a joint; equal sides stay one object."""
        if content[0] == content[1]:
            side_changes = [each.inside if each.words[0] == ALL else each for each in changes]
            new_side = self.in_value(kind.item, content[0], side_changes, place)
            return new_side, new_side
        for words, _ in changes:
            if words[0] != ALL:
                choices = f"0, 1 or {ALL}, as in {_dotted_path((*place, '0', *words))}"
                raise InputError.one(f"{_dotted_path(place)}: its two sides differ; say which by {choices}")
        return self._in_list(kind, kind.item, content, changes, place)

    def _in_list(
        self,
        kind: ValueKind,
        entry_kind: ValueKind,
        content: Any,
        changes: Sequence[_NewValue],
        place: tuple[str, ...],
    ) -> Any:
        """Return a list with the replacements in the entries that words name, or in all entries."""
        names = entry_names(kind, content, self.scope.members)
        indices, entries = _indices(names), list(content)
        by_index: dict[int, list[_NewValue]] = {}
        for change in changes:
            word = change.words[0]
            if word != ALL and word not in indices:
                raise _missing_word_error(word, indices, place)
            if word != ALL and entries[indices[word]] is None:
                exempt = self.scope.exempt.get(getattr(kind, "purpose", ""), {})
                reason = exempt.get(names[indices[word]], "it has none")
                raise InputError.one(f"{_dotted_path((*place, word))}: no value goes there: {reason}")
            nonempty_indices = [index for index, entry in enumerate(entries) if entry is not None]
            for index in nonempty_indices if word == ALL else [indices[word]]:
                by_index.setdefault(index, []).append(change.inside)
        for index, inner_changes in by_index.items():
            member_replacements = _Replacements(self.scope.of_member(names[index]))
            entry_place = (*place, names[index] or str(index))
            entries[index] = member_replacements.in_value(
                entry_kind, content[index], inner_changes, entry_place
            )
        return tuple(entries)

    def _with_entry(
        self, kind: ValueKind, content: Any, word: str, mapping: MapNode, place: tuple[str, ...]
    ) -> Any:
        """Return entries by name with a mapping as the one that a word names, or as a further one."""
        names, key = entry_names(kind, content, {}), "name"
        index = _indices(names).get(word)
        name = word if index is None else names[index]
        entries = {key: TextNode(0, name, plain=False), **mapping.entries}
        named_mapping = mapping._replace(entries=entries, key_lines={key: 0, **mapping.key_lines})
        entry = self._read_value(kind.item or kind, named_mapping, (*place, name))
        return tuple({**dict(zip(names, content, strict=True)), name: entry}.values())


def _by_first_word(changes: Iterable[_NewValue]) -> dict[str, list[_NewValue]]:
    by_word: dict[str, list[_NewValue]] = {}
    for change in changes:
        by_word.setdefault(change.words[0], []).append(change.inside)
    return by_word


def _check_single(changes: Sequence[_NewValue], place: tuple[str, ...]) -> None:
    """Refuse changes of a value of which one replaces it as a whole."""
    if len(changes) > 1:
        raise InputError.one(f"{_dotted_path(place)} and a part of it are replaced")
