"""YAML text to a tree: lines, anchors, and what YAML offers but these files do not."""

import re

import pytest

from vsacli import InputError
from vsacli.documents.source import Problems
from vsacli.documents.tree import MAX_LEVELS, MAX_NODES, ListNode, MapNode, TextNode, parse_yaml


def parse(text):
    problems = Problems("file.yaml")
    root = parse_yaml(text, problems)
    problems.check()
    return root


def messages(text):
    with pytest.raises(InputError) as caught:
        parse(text)
    return str(caught.value).splitlines()


def test_scalars_stay_texts_and_know_their_line_and_quotes():
    root = parse("a: 010\nb: 'on'\n\nc:\nd: on\n")
    assert root.entries == {
        "a": TextNode(1, "010", plain=True),
        "b": TextNode(2, "on", plain=False),
        "c": TextNode(4, "", plain=True),
        "d": TextNode(5, "on", plain=True),
    }
    assert root.key_lines == {"a": 1, "b": 2, "c": 4, "d": 5}


def test_lists_and_mappings_stand_where_their_key_stands():
    root = parse("a:\n  b:\n    c: 1\nd:\n  - x\n  - e: 1\n")
    assert root.entries["a"].line == 1
    assert root.entries["a"].entries["b"].line == 2
    assert root.entries["d"].line == 4
    assert [item.line for item in root.entries["d"].items] == [5, 6]


@pytest.mark.parametrize("null", ["", "~", "null", "Null"])
def test_plain_nulls_hold_nothing(null):
    assert parse(f"a: {null}").entries["a"].is_null


def test_a_quoted_null_is_a_text():
    assert not parse("a: 'null'").entries["a"].is_null


def test_aliases_stand_for_their_anchor_with_its_lines():
    root = parse("a: &x {b: 1}\nc: *x\nd: [*x, &y 2, *y]\n")
    assert root.entries["c"] == root.entries["a"] == MapNode(1, {"b": TextNode(1, "1", plain=True)}, {"b": 1})
    assert root.entries["d"].items[1:] == (TextNode(3, "2", plain=True),) * 2


def test_windows_line_ends_and_byte_order_mark_free_text():
    assert parse("a: 1\r\nb: 2\r\n").key_lines == {"a": 1, "b": 2}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a: 1\nb: 2\na: 3\n", "file.yaml:3: duplicate key 'a'; it is already on line 1"),
        ("a: 1\n'a': 3\n", "file.yaml:2: duplicate key 'a'; it is already on line 1"),
        (
            "x: &d {a: 1}\ny:\n  <<: *d\n",
            "file.yaml:3: merge keys (<<) are not allowed; write the entries out",
        ),
        (
            "a: !!float 3\n",
            "file.yaml:1: the tag '!!float' is not allowed; write the plain value without a tag",
        ),
        ("a:\n  b: !own [1]\n", "file.yaml:2: the tag '!own' is not allowed"),
        (
            "a: !!python/object/apply:os.system ['true']\n",
            "file.yaml:1: the tag '!!python/object/apply:os.system'",
        ),
        ("a: 1\n---\nb: 2\n", "file.yaml:2: a second document begins here; a file holds exactly one"),
        ("a: *x\n", "file.yaml:1: the alias *x has no anchor; write &x before a value above"),
        (
            "a: &spring 1\nb: *sprng\n",
            "file.yaml:2: the alias *sprng has no anchor; did you mean *spring (line 1)?",
        ),
        ("a: &x [1, *x]\n", "file.yaml:1: the alias *x is inside the value of its own anchor &x"),
        ("a: 1\n? [b, c]\n: 2\n", "file.yaml:2: a key must be a word, found a list of 2"),
        ("# only\n# comments\n", "file.yaml:1: has only comments, no values"),
        ("a: [1, 2\n\nb: 3\n", "file.yaml:3: not valid YAML at column 2: "),
        ("a: [1, 2\nc, 3\n\n", "file.yaml:2: not valid YAML: did not find expected ',' or ']'"),
        ("a: b: c\n", "file.yaml:1: not valid YAML at column 5: mapping values are not allowed"),
        ("a:\n\t- b\n", "; YAML is indented with spaces, not tabs"),
        ("a: 'open\n\nb\n", "file.yaml:3: not valid YAML: found unexpected end of stream"),
        ("a: 'open\n\nb\n", ", while scanning a quoted scalar that begins on line 1"),
        ("a: 1\nb: \x00\n", "file.yaml:2: the character U+0000 is not allowed in YAML; is this a text file?"),
    ],
)
def test_one_problem_is_one_line(text, problem):
    (message,) = messages(text)
    assert problem in message


def test_every_problem_is_reported_in_the_order_of_lines():
    found = messages("a: !!int 1\nb: *nowhere\na: 2\nc: [")
    assert [re.match(r"file.yaml:(\d)", line)[1] for line in found] == ["1", "2", "3", "4"]


def nested(levels):
    return "[" * levels + "]" * levels


def test_nesting_up_to_the_limit():
    assert isinstance(parse(nested(MAX_LEVELS)), ListNode)
    assert messages(nested(MAX_LEVELS + 1)) == ["file.yaml:1: nested more than 20 levels deep"]


def test_nesting_through_aliases_counts():
    half = MAX_LEVELS // 2
    outside = "[" * (half - 1) + "*x" + "]" * (half - 1)
    assert parse(f"a: &x {nested(half)}\nb: {outside}\n")
    assert messages(f"a: &x {nested(half)}\nb: [{outside}]\n") == [
        "file.yaml:2: nested more than 20 levels deep"
    ]


@pytest.mark.slow
def test_number_of_nodes_up_to_the_limit():
    assert len(parse("- 1\n" * (MAX_NODES - 1)).items) == MAX_NODES - 1
    (message,) = messages("- 1\n" * MAX_NODES)
    assert (
        message
        == f"file.yaml:{MAX_NODES}: more than 100,000 keys and values, counting what aliases stand for"
    )


def test_what_aliases_stand_for_is_counted():
    tenfold = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 4)
    )
    assert parse(tenfold)  # lists of 10, 101, 1011 and 10111 nodes
    (message,) = messages(tenfold + "b: [" + ", ".join(["*a3"] * 10) + "]\n")
    assert message.startswith("file.yaml:5: more than 100,000 keys and values")


def test_many_problems_end_the_reading():
    found = messages("a: 1\n" * 1000)
    assert len(found) == 51
    assert found[-1] == "file.yaml:52: more than 50 problems; reading stopped here"
