"""Masses and inertias of links that no rigid body has, with the line of the robot file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.errors import Problem
from vsacli.documents.plausibility import Measured, ValuesInFile
from vsacli.documents.record_values import NumberPath
from vsacli.robot.joint import INERTIA_ROUNDING, Inertia, Joint
from vsacli.robot.plausibility.checked_robot import joint_path

UNIT = "kg m^2"


def impossible_links(joints: Sequence[Joint], file_lines: ValuesInFile | None) -> Iterator[Problem]:
    """Yield warnings about links without mass or inertia, and about broken triangle inequalities.

    A robot without any mass has no warnings about zeros, since one for the whole robot says so.
    """
    massless = not any(joint.link.mass for joint in joints)
    for number, joint in enumerate(joints):
        path, link = joint_path(number, joint, "link"), joint.link
        no_inertia = link.inertia.principal_moments[-1] == 0
        if not massless and link.mass == 0 and no_inertia:
            advice = "give those of the link, the inertia about its center of mass"
            yield _problem_at_path(path, f": mass and inertia are zero; {advice}", file_lines)
        elif not massless and link.mass == 0:
            yield _problem_at_path((*path, "mass"), " is zero; give the mass of the link, in kg", file_lines)
        elif not massless and no_inertia:
            advice = f"give the inertia of the link about its center of mass, in {UNIT}"
            yield _problem_at_path((*path, "inertia"), f" is zero; {advice}", file_lines)
        if excess := _describe_triangle_violation((*path, "inertia"), link.inertia, file_lines):
            advice = "which no rigid body allows; check the entries"
            yield _problem_at_path((*path, "inertia"), f": {excess}, {advice}", file_lines)


def _describe_triangle_violation(path: NumberPath, inertia: Inertia, file_lines: ValuesInFile | None) -> str:
    """Return by how much the largest moment exceeds the sum of the others; empty if it does not.

    Moments are named by their axes if these are principal axes, unless the file has other axes.
    """
    low, middle, high = inertia.principal_moments
    if high - low - middle <= INERTIA_ROUNDING * high:
        return ""
    names = ["xx", "yy", "zz"]
    largest = names.pop(int(np.argmax(np.diag(inertia.tensor))))
    in_file = file_lines is None or _is_written((*path, largest), high, file_lines)
    if in_file and np.count_nonzero(inertia.tensor - np.diag(np.diag(inertia.tensor))) == 0:
        moment, sum_of_others = f"{largest} =", f"{' + '.join(names)} ="
    else:
        moment, sum_of_others = "the largest principal moment", "the sum of the others"
    by = f"by {high - low - middle:.4g} {UNIT}"
    return f"{moment} {high:.4g} {UNIT} exceeds {sum_of_others} {low + middle:.4g} {UNIT} {by}"


def _is_written(path: NumberPath, value: float, file_lines: ValuesInFile) -> bool:
    return file_lines.as_in_file(Measured(path, value, UNIT, math.nan)) is not None


def _problem_at_path(path: NumberPath, message: str, file_lines: ValuesInFile | None) -> Problem:
    """Return a problem with the line of a path, unless the file has another mass there: it was changed."""
    message = ".".join(map(str, path)) + message
    if file_lines is None or (path[-1] == "mass" and not _is_written(path, 0.0, file_lines)):
        return Problem("", 0, message)
    return Problem(file_lines.path, file_lines.line(path), message)
