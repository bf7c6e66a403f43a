"""The same recorded motion as various programs export it, with what a trajectory file says of each.

Written after the programs' documentation:

- `rostopic echo -p`: https://wiki.ros.org/rostopic (times in nanoseconds, `field.` before each name, arrays
  with their index at the end)
- `ros2 topic echo --csv`: https://docs.ros.org/en/rolling/Concepts/Basic/About-Command-Line-Tools.html (no
  header; the fields of `sensor_msgs/JointState` in their order)
- PlotJuggler: https://github.com/facontidavide/PlotJuggler/blob/main/README.md (`__time`, topics as paths)
- `writetable`, `writematrix`: https://www.mathworks.com/help/matlab/ref/writetable.html,
  https://www.mathworks.com/help/matlab/ref/writematrix.html (names of variables without dots, or no header)
- `DataFrame.to_csv`: https://pandas.pydata.org/docs/reference/api/pandas.DataFrame.to_csv.html (the first
  column without a name)
- a spreadsheet with a German locale: semicolons, decimal commas, CRLF, a byte order mark
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

SAMPLES = 61
SEED = 5
FIRST = 1605549604543212345
"""Nanoseconds since 1970 of the first sample."""

JOINTS = ("shoulder", "elbow")


class Motion(NamedTuple):
    """A recorded motion: nanoseconds from the first sample on, and positions, rad, of both joints."""

    nanoseconds: list[int]
    positions: list[list[float]]

    @property
    def seconds(self) -> list[str]:
        """The times in decimal notation, without a digit lost."""
        return [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in self.nanoseconds]


class Export(NamedTuple):
    """A file, and what is said of its columns."""

    content: str
    columns: str
    ignore: str = ""


def motion() -> Motion:
    """Half a second at about 100 Hz, with stamps that jitter."""
    jitter = np.random.default_rng(SEED).integers(-900_000, 900_000, SAMPLES)
    nanoseconds = (np.arange(SAMPLES) * 10_000_000 + jitter - jitter[0]).tolist()
    time = np.array(nanoseconds) / 1e9
    positions = np.transpose([0.4 * np.sin(5 * time), 0.3 - 0.2 * np.cos(4 * time)])
    return Motion(nanoseconds, positions.tolist())


def plain(recorded: Motion) -> str:
    """The file as the project's own format has it."""
    rows = ([time, *map(repr, q)] for time, q in _rows(recorded))
    return _table(["time", *(f"{joint}.q" for joint in JOINTS)], rows)


def rostopic(recorded: Motion) -> Export:
    header = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    arrays = ("name", "position", "velocity", "effort")
    header += [f"field.{name}{index}" for name in arrays for index in range(2)]
    stamps = (FIRST + ns for ns in recorded.nanoseconds)
    rows = (
        [str(stamp + 310), "7", str(stamp), "", *JOINTS, *map(repr, q), "0.1", "-0.25", "nan", "nan"]
        for stamp, q in zip(stamps, recorded.positions, strict=True)
    )
    columns = """
    time: {column: field.header.stamp, unit: ns}
    shoulder.q: field.position0
    elbow.q: field.position1"""
    return Export(_table(header, rows), columns, "rest")


def ros2_topic(recorded: Motion) -> Export:
    """Whole seconds and nanoseconds are columns of their own, and names stand in each row."""
    stamps = [divmod(FIRST + ns, 10**9) for ns in recorded.nanoseconds]
    rows = (
        [str(seconds), str(rest), "base", *JOINTS, *map(repr, q), "0.1", "-0.25"]
        for (seconds, rest), q in zip(stamps, recorded.positions, strict=True)
    )
    columns = """
    time: {column: 1, nanoseconds: 2}
    shoulder.q: 6
    elbow.q: 7"""
    return Export(_table([], rows), columns, "rest")


def plotjuggler(recorded: Motion) -> Export:
    """Topics of other rates leave cells empty."""
    header = ["__time", "/battery/voltage", "/joint_states/position[0]", "/joint_states/position[1]"]

    def rows() -> Iterator[list[str]]:
        for index, (time, q) in enumerate(_rows(recorded)):
            yield [time, "", *map(repr, q)]
            if index % 7 == 0:
                yield [f"{time}5", "24.1", "", ""]

    columns = """
    time: __time
    shoulder.q: "/joint_states/position[0]"
    elbow.q: "/joint_states/position[1]" """
    return Export(_table(header, rows()), columns, "['/battery/voltage']")


def writetable(recorded: Motion) -> Export:
    rows = ([time, *map(repr, q), '"run 3, left"'] for time, q in _rows(recorded))
    columns = """
    time: Time
    shoulder.q: shoulder_q
    elbow.q: elbow_q"""
    return Export(_table(["Time", "shoulder_q", "elbow_q", "remark"], rows), columns, "[remark]")


def writematrix(recorded: Motion) -> Export:
    rows = ([time, *map(repr, q)] for time, q in _rows(recorded))
    return Export(_table([], rows), "{time: 1, shoulder.q: 2, elbow.q: 3}")


def pandas(recorded: Motion) -> Export:
    rows = ([str(index), time, *map(repr, q)] for index, (time, q) in enumerate(_rows(recorded)))
    header = ["", "t", "pos", "pos"]
    return Export(_table(header, rows), "{time: t, shoulder.q: 3, elbow.q: 4}", "rest")


def spreadsheet(recorded: Motion) -> Export:
    """Headings in quotes, in one of which there is a semicolon."""
    rows = ([cell.replace(".", ",") for cell in [time, *map(repr, q)]] for time, q in _rows(recorded))
    header = ['"Zeit; gemessen"', '"Schulter"', '"Ellbogen [rad]"']
    columns = """
    time: "Zeit; gemessen"
    shoulder.q: Schulter
    elbow.q: Ellbogen"""
    text = "\ufeff" + _table(header, rows, ";").replace("\n", "\r\n")
    return Export(text, columns)


def tabs(recorded: Motion) -> Export:
    rows = (
        [str(ns), *map(repr, q)] for ns, (_, q) in zip(recorded.nanoseconds, _rows(recorded), strict=True)
    )
    columns = "{time: stamp, shoulder.q: shoulder.q, elbow.q: elbow.q}"
    return Export(_table(["stamp [ns]", "shoulder.q", "elbow.q"], rows, "\t"), columns)


EXPORTS: dict[str, Callable[[Motion], Export]] = {
    each.__name__: each
    for each in (rostopic, ros2_topic, plotjuggler, writetable, writematrix, pandas, spreadsheet, tabs)
}


def _rows(recorded: Motion) -> Iterator[tuple[str, list[float]]]:
    return zip(recorded.seconds, recorded.positions, strict=True)


def _table(header: Sequence[str], rows: Iterator[list[str]], separator: str = ",") -> str:
    lines = [separator.join(cells) for cells in rows]
    return "\n".join([*([separator.join(header)] if header else []), *lines]) + "\n"
