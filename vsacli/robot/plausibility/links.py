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


def impossible_links(joints: Sequence[Joint], written: ValuesInFile | None) -> Iterator[Problem]:
    """Yield warnings about links without mass or inertia, and about broken triangle inequalities.

    A robot without any mass has no warnings about zeros, since one for the whole robot says so.
    """
    massless = not any(joint.link.mass for joint in joints)
    for number, joint in enumerate(joints):
        path, link = joint_path(number, joint, "link"), joint.link
        no_inertia = link.inertia.principal_moments[-1] == 0
        if not massless and link.mass == 0 and no_inertia:
            advice = "give those of the link, the inertia about its center of mass"
            yield _problem(path, f": mass and inertia are zero; {advice}", written)
        elif not massless and link.mass == 0:
            yield _problem((*path, "mass"), " is zero; give the mass of the link, in kg", written)
        elif not massless and no_inertia:
            advice = f"give the inertia of the link about its center of mass, in {UNIT}"
            yield _problem((*path, "inertia"), f" is zero; {advice}", written)
        if excess := _excess((*path, "inertia"), link.inertia, written):
            advice = "which no rigid body allows; check the entries"
            yield _problem((*path, "inertia"), f": {excess}, {advice}", written)


def _excess(path: NumberPath, inertia: Inertia, written: ValuesInFile | None) -> str:
    """Return by how much the largest moment exceeds the sum of the others; empty if it does not.

    Moments are named by their axes if these are principal axes, unless the file has other axes.
    """
    low, middle, high = inertia.principal_moments
    if high - low - middle <= INERTIA_ROUNDING * high:
        return ""
    names = ["xx", "yy", "zz"]
    largest = names.pop(int(np.argmax(np.diag(inertia.tensor))))
    in_file = written is None or _is_written((*path, largest), high, written)
    if in_file and np.count_nonzero(inertia.tensor - np.diag(np.diag(inertia.tensor))) == 0:
        moment, others = f"{largest} =", f"{' + '.join(names)} ="
    else:
        moment, others = "the largest principal moment", "the sum of the others"
    by = f"by {high - low - middle:.4g} {UNIT}"
    return f"{moment} {high:.4g} {UNIT} exceeds {others} {low + middle:.4g} {UNIT} {by}"


def _is_written(path: NumberPath, value: float, written: ValuesInFile) -> bool:
    return written.as_in_file(Measured(path, value, UNIT, math.nan)) is not None


def _problem(path: NumberPath, message: str, written: ValuesInFile | None) -> Problem:
    """Return a problem with the line of a path, unless the file has another mass there: it was changed."""
    message = ".".join(map(str, path)) + message
    if written is None or (path[-1] == "mass" and not _is_written(path, 0.0, written)):
        return Problem("", 0, message)
    return Problem(written.path, written.line(path), message)
