"""Values of an identification: results of parameters, residuals of motors and links, use of recordings."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.base.texts import counted

CHANGED = 3.0
"""Difference from the file, in standard errors, that is a change. Of a hundred unchanged parameters, five
exceed two standard errors by chance, and less than one exceeds three."""


@dataclass(frozen=True)
class Number(Published):
    """The result for one parameter of a robot.

    Attributes:
        path: path of the parameter in the robot, or name of a base parameter.
        unit: unit of all values.
        before: value in the robot file.
        value: identified value, or the previous one.
        standard_error: standard error of the value; NaN if unidentifiable.
        note: reason why it is unidentifiable, or at a bound; otherwise empty.
        sum: terms of a base parameter, which the file does not have; otherwise empty.
    """

    path: str
    unit: str
    before: float
    value: float
    standard_error: float
    note: str = ""
    sum: str = ""

    shape: ClassVar = {
        **named("path", "unit", "before", "value", "standard_error", "off", "changed"),
        "note?": "note",
        "sum?": "sum",
    }

    @property
    def identifiable(self) -> bool:
        """Whether the parameter was identified."""
        return math.isfinite(self.standard_error)

    @property
    def off(self) -> float:
        """Difference from the file in standard errors; NaN if unidentifiable."""
        difference = self.value - self.before
        if not (difference and self.identifiable):
            return 0.0 * self.standard_error
        return difference / self.standard_error

    @property
    def changed(self) -> bool:
        """Whether the value differs from the file by more than `CHANGED` standard errors."""
        return self.identifiable and abs(self.value - self.before) > CHANGED * self.standard_error


FAR = 3.0
"""Factor between an identified value and the file beyond which it is far. Parameters from data sheets and CAD
are better; those of another robot are not."""


def far_from_file(numbers: Iterable[Number]) -> list[str]:
    """Return a sentence if most identified parameters are far from the file, otherwise nothing."""
    known = [each for each in numbers if each.identifiable and each.before and not each.sum]
    far = [each for each in known if each.changed and not 1 / FAR < each.value / each.before < FAR]
    if 2 * len(far) <= len(known):
        return []
    differ = "differs" if len(far) == 1 else "differ"
    return [
        f"{len(far)} of {counted(len(known), 'parameter')} {differ} from the file by more than a factor of "
        f"{FAR:g}: is it the recording of another robot? If not, repeat with the robot file that -o writes"
    ]


@dataclass(frozen=True)
class Residual(Published):
    """The residual of the equations of a motor or a link, as root mean squares after the filter.

    Attributes:
        group: name of the motor or link.
        unit: unit of all values.
        torque: measured torque.
        residual: measured minus predicted torque.
        noise: noise of the residual, expected from the noise of torque and positions; NaN if unknown.
        held_out: residual on held-out samples; NaN if nothing was held out.
    """

    group: str
    unit: str
    torque: float
    residual: float
    noise: float
    held_out: float


@dataclass(frozen=True)
class TorqueDeviation(Published):
    """The uncertainty of a motor's torque that is computed with the fitted robot.

    Standard deviations follow from the covariance of the parameters found.

    Attributes:
        motor: name of the motor.
        unit: unit of all values.
        torque: largest torque along the recordings.
        deviation: largest standard deviation along the recordings.
        elsewhere: largest standard deviation with positions, velocities, accelerations and stiffness that
            were recorded at different times.
    """

    motor: str
    unit: str
    torque: float
    deviation: float
    elsewhere: float


@dataclass(frozen=True)
class SystemReport(Published):
    """The results for the parameters of a joint's motors and springs, or of the links.

    Attributes:
        title: name of the joint, or "links".
        numbers: results for all unknown parameters.
        condition: condition number of the columns of the equations.
        combinations: identifiable combinations of indistinguishable parameters, as sentences.
        residuals: residuals of each motor or link.
        converged: whether the fit converged.
    """

    title: str
    numbers: tuple[Number, ...]
    condition: float
    combinations: tuple[str, ...]
    residuals: tuple[Residual, ...]
    converged: bool = True


@dataclass(frozen=True)
class RecordReport(Published):
    """Properties of a recording and its use.

    Attributes:
        path: path of the file.
        duration: duration of the used part, s.
        rate: sample rate, Hz.
        bandwidth: bandwidth of the filter, Hz.
        delay: delay of torques behind positions, s; NaN if unidentifiable.
        delay_error: standard error of the delay, s.
        corrected: whether the delay was removed.
        doubts: likely faults, as sentences.
        unused: columns that were not required.
    """

    path: str
    duration: float
    rate: float
    bandwidth: float
    delay: float
    delay_error: float
    corrected: bool
    doubts: tuple[str, ...]
    unused: tuple[str, ...]
