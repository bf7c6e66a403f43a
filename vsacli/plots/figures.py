"""The figures of a file, whatever its kind."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from vsacli.plots.curves import Failures
from vsacli.plots.drawings import Drawing, drawable_figures
from vsacli.plots.result import RESULT_DRAWINGS
from vsacli.plots.simulation import simulation_drawings
from vsacli.plots.style import house_style
from vsacli.store.reader import StoredResult
from vsacli.store.simulation import StoredSimulation


def drawings_of(stored: StoredResult) -> Mapping[str, Drawing]:
    """The figures that a file of its kind has, by name."""
    if isinstance(stored, StoredSimulation):
        return simulation_drawings(stored.actuators)
    return RESULT_DRAWINGS


def plot_stored(stored: StoredResult) -> dict[str, Figure]:
    """Draw the figures of a result or a simulation by name, all but the `omitted_figures`.

    Raises:
        InputError: nothing can be drawn from what is stored.
    """
    drawings = drawings_of(stored)
    names = drawable_figures(drawings, stored.variables, stored.path)
    with house_style():
        failures = Failures.of(stored)
        return {name: drawings[name].draw(stored, failures) for name in names}
