"""The figures of a file, whatever its kind."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from vsacli.results.plots.curves import Failures
from vsacli.results.plots.drawings import Drawing, drawable_figures
from vsacli.results.plots.result_figures import RESULT_DRAWINGS
from vsacli.results.plots.simulation_figures import simulation_drawings
from vsacli.results.plots.style import house_style
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.simulation import StoredSimulation


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
