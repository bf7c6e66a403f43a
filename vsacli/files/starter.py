"""How long the motion of a new trajectory file has to last, so that its robot can execute it."""

from __future__ import annotations

import math

from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.base.storage import reporting_temporary_errors, temporary_folder
from vsacli.robot.model import Robot
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.motions import Passage
from vsacli.studies.remedies.slow_down import smallest_slow_down
from vsacli.trajectory.file import load_trajectory
from vsacli.trajectory.trajectory import Trajectory


def possible_duration(robot: Robot, text: str, usual: float) -> tuple[float, str]:
    """The duration of a trajectory file that the robot can execute, and a remark if it is not the usual one.

    Args:
        robot: the robot.
        text: of the file, with the usual duration.
        usual: duration, s.

    Raises:
        StorageError: there is no room for a temporary file.
    """
    acceptance, trajectory = Acceptance(robot, NEAR_SINGULAR_MARGIN), _read(text, robot)
    if not acceptance.refused_joints(trajectory).any():
        return usual, ""
    reasons = "; ".join(acceptance.reasons(Passage.of(trajectory, 0, trajectory.samples)))
    try:
        duration = usual * smallest_slow_down(acceptance, trajectory)
    except ImpossibleError as error:
        return usual, f"This robot cannot execute it, nor more slowly: {error}."
    rounded = _rounded_up(duration)
    if not acceptance.refused_joints(trajectory.stretched(rounded / usual)).any():
        duration = rounded
    return duration, f"It does not take {usual:g} s, since then {reasons}."


def _read(text: str, robot: Robot) -> Trajectory:
    with temporary_folder() as folder:
        path = folder / "starter.yaml"
        with reporting_temporary_errors():
            path.write_text(text, encoding="utf-8")
        return load_trajectory(path, robot)


def _rounded_up(duration: float) -> float:
    """To two digits."""
    unit = 10.0 ** (math.floor(math.log10(duration)) - 1)
    return float(f"{math.ceil(duration / unit) * unit:.6g}")
