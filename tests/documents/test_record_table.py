"""Records from CSV: units in headers, texts in quotes, and what every refusal says."""

from dataclasses import dataclass

import pytest

from vsacli import InputError
from vsacli.base import units
from vsacli.documents.fields import POSITIVE, Name, number, value
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.record_table import read_records


@dataclass(frozen=True)
class Fruit(DeclaredRecord):
    name: str = value(Name(), "what it is called")
    mass: float = number(units.MASS, "mass", check=POSITIVE)
    speed: float | None = number(units.VELOCITY, "speed", check=POSITIVE, default=None)


@pytest.fixture
def read(tmp_path):
    def reading(content):
        path = tmp_path / "fruits.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_records(path, Fruit, "name")

    return reading


@pytest.mark.parametrize(
    "content",
    [
        "name,mass,speed\napple,0.1,2\npear,0.2,\n",
        "\ufeffname;mass;speed\r\napple;0.1;2\r\npear;1/5;\r\n",
        "# fruits\n\nspeed\tmass [g]\tname\n2\t100\tapple # red\n\t200\tpear\n\n",
        '"name","mass","speed[rad/ms]"\n"apple",0.1,"0.002"\n"pear", 0.2 ,""',
        "name,color,mass,speed\napple,red,0.1,2\npear,,0.2,",
    ],
)
def test_tables_that_are_accepted(read, content):
    found = read(content)
    assert [each.name for each in found.records] == ["apple", "pear"]
    assert [each.mass for each in found.records] == pytest.approx([0.1, 0.2])
    assert [each.speed for each in found.records] == [2, None]
    assert found.unknown_columns == (("color",) if "color" in content else ())


def test_names_may_hold_separators_and_look_like_anything(read):
    found = read('name,mass\n"apple, red",1\nnull,2\nyes,3\n1e3,4\n')
    assert [each.name for each in found.records] == ["apple, red", "null", "yes", "1e3"]
    assert found.lines == (2, 3, 4, 5)


@pytest.mark.parametrize(
    ("content", "line", "message"),
    [
        ("name,weight\napple,1", 1, r"missing column 'mass' \(mass\)$"),
        ("name,masss\napple,1", 1, "unknown column 'masss'; did you mean 'mass'?"),
        ("name,mass,mass[g]\napple,1,1", 1, "column 'mass' appears more than once"),
        ("name,mass[m]\napple,1", 1, r"column 'mass': \[m\] is a length, expected a mass in kg or g"),
        (
            "name,mass[stone]\napple,1",
            1,
            r"column 'mass': unknown unit \[stone\]; expected a mass in kg or g",
        ),
        ("name[m],mass\napple,1", 1, "column 'name': holds texts, which have no unit"),
        ("1,2\n3,4", 1, "expected a header line with column names such as time, base.q, found numbers"),
        ("name,mass\n# nothing", 0, "no rows of values"),
        ("name,mass\napple,1\npear", 3, "expected 2 values, one for each column of the header, found 1"),
        ("name,mass\napple,1,5", 2, "one for each column of the header, found 3; names with the separator"),
        ("name,mass\napple,-1", 2, "mass: must be positive, not -1 kg$"),
        ("name,mass[g]\napple,-135", 2, "mass: must be positive, not -135 g$"),
        ("name,weight", 1, r"missing column 'mass' \(mass\)$"),
        ("weight\n1", 1, r"missing columns 'name' \(.*\), 'mass' \(mass\)$"),
        ("name,mass\napple,nan", 2, "mass: .*only finite numbers"),
        ("name,mass[g]\napple,nan", 2, "mass: .*only finite numbers"),
        ("name,mass\napple,inf", 2, "mass: .*only finite numbers"),
        ('name;mass\napple;"1,5"', 2, "mass: .*write a decimal point, not a comma"),
        ("name,mass\napple,heavy", 2, "mass: expected a number in kg, found 'heavy'"),
        ("name,mass\napple,", 2, "column 'mass' is empty"),
        ("name,mass\n,1", 2, "column 'name' is empty"),
        ("name,mass\napple,1\npear,1\napple,2", 4, "the name 'apple' is already used in line 2"),
        ("name,mass\napple,1\x00", 2, "mass: "),
        (b"name,mass\nappl\xe9,1", 2, "byte 0xe9 is not valid UTF-8"),
    ],
)
def test_refusals_say_where_and_what(read, content, line, message):
    with pytest.raises(InputError, match=message) as caught:
        read(content)
    assert [problem.line for problem in caught.value.problems] == [line]


def test_everything_that_is_wrong_is_told_at_once(read):
    with pytest.raises(InputError) as caught:
        read("name,mass,speed\napple,-1,0\npear,,3\nplum,1,x")
    assert [problem.line for problem in caught.value.problems] == [2, 2, 3, 4]
