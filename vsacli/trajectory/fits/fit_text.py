"""What a report says about fits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.trajectory.fits.fit import Fit, Part
from vsacli.trajectory.fits.selection import INTERPOLATE, LEAST_SQUARES


def fit_sentences(
    value: str, fitted: Sequence[str], labels: Sequence[str], time: FloatArray, fit: Fit
) -> Iterator[str]:
    """Which numbers come from splines, how far these are from the samples, and where they are doubtful.

    Args:
        value: name of the signal.
        fitted: the derivatives that come from splines.
        labels: of the components.
        time: (samples,), s.
        fit: of the signal.
    """
    if not fitted or not fit.parts:
        return
    exact = [part for part in fit.parts if part.exact]
    smooth = [part for part in fit.parts if not part.exact]
    names = ", ".join(fitted)
    verb = "comes" if len(fitted) == 1 else "come"
    of_some = bool(exact and smooth)
    if exact:
        whose = f" of {_members(exact, labels)}" if of_some else ""
        yield f"{names}{whose} {verb} from a C{fit.degree - 1} spline through {value}; {_trust(time, exact)}"
    if smooth:
        whose = f" of {_members(smooth, labels)}" if of_some else ""
        source = f"come from a C{fit.degree - 1} least-squares spline near the samples of {value}"
        yield f"{value}, {names}{whose} {source}: {_misfit(smooth, labels, fit)}; {_trust(time, smooth)}"


def describe(value: str, labels: Sequence[str], fit: Fit) -> dict[str, Any]:
    """What is known of a fit, as JSON values.

    Args:
        value: name of the signal.
        labels: of the components.
        fit: of the signal.
    """
    parts = {int(member): part for part in fit.parts for member in part.members}
    return {
        "signal": value,
        "degree": fit.degree,
        "columns": [
            {
                "name": labels[member],
                "method": INTERPOLATE if part.exact else LEAST_SQUARES,
                "knots": len(part.knots),
                "residual": {"rms": float(fit.residual[member]), "max": float(fit.largest[member])},
                "noise": float(fit.noise[member]),
                "doubtful": dict(zip(("start", "end"), part.doubtful, strict=True)),
            }
            for member, part in sorted(parts.items(), key=itemgetter(0))
        ],
    }


def _members(parts: Sequence[Part], labels: Sequence[str]) -> str:
    return ", ".join(labels[i] for i in sorted(member for part in parts for member in part.members.tolist()))


def _misfit(parts: Sequence[Part], labels: Sequence[str], fit: Fit) -> str:
    knots = [len(part.knots) for part in parts]
    count = f"{min(knots)} to {max(knots)}" if min(knots) < max(knots) else f"{knots[0]}"
    worst = int(np.argmax(fit.largest))
    largest = f"at most {fit.largest[worst]:.2g} ({labels[worst]})"
    return f"{count} knots, off by {np.max(fit.residual):.2g} rms, {largest}"


def _trust(time: FloatArray, parts: Sequence[Part]) -> str:
    start, end = (max(stretch) for stretch in zip(*(part.doubtful for part in parts), strict=True))
    if start + end >= time[-1] - time[0]:
        return "on so few knots, derivatives are doubtful far into the record from both ends"
    return f"derivatives are doubtful in the first {start:.3g} s and the last {end:.3g} s"
