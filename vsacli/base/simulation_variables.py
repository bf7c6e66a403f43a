"""The variables of a simulation: those of the inverse dynamics as commanded, as they were, and apart."""

from __future__ import annotations

from collections.abc import Iterator

from vsacli.base.variables import VARIABLES, Variable

TRACKED = ("q", "dq", "ddq", "stiffness", "dstiffness")
"""Commanded variables from which a simulation deviates."""

ACTUAL = (
    *TRACKED,
    *("tau_e", "phi", "dphi", "theta", "dtheta", "tau_transmission", "tau_motor"),
    *("elastic_energy", "motor_power", "motor_energy", "det_A"),
    *("damping", "tau_damper"),
    *("dissipated_power", "current", "voltage", "copper_loss"),
)
ERRORS = ("q", "dq", "stiffness", "dstiffness")
MEASURED = ("q", "theta", "tau_motor")
"""Variables that sensors read."""


def actual(name: str) -> str:
    """Name under which the actual value of a variable is stored."""
    return f"{name}_actual"


def measured(name: str) -> str:
    """Name under which the reading of a variable is stored."""
    return f"{name}_measured"


def error(name: str) -> str:
    """Name under which the error of a variable is stored, actual minus commanded."""
    return f"{name}_error"


def _declared() -> Iterator[Variable]:
    yield VARIABLES["time"]
    yield from (VARIABLES[name] for name in TRACKED)
    yield VARIABLES["tau_motor"]._replace(
        long_name="motor torque that the controller asks for", equation="controller"
    )
    for name in ACTUAL:
        was = VARIABLES[name]
        words = was.long_name.replace("commanded ", "")
        yield was._replace(name=actual(name), long_name=f"{words}, as it was", equation="(5)")
    for name in ERRORS:
        words = VARIABLES[name].long_name.replace("commanded ", "")
        yield VARIABLES[name]._replace(name=error(name), long_name=f"{words}, actual minus commanded")
    for name in MEASURED:
        was, words = VARIABLES[name], VARIABLES[name].long_name.replace("commanded ", "")
        yield was._replace(
            name=measured(name), long_name=f"{words}, as measured", equation=f"{actual(name)}, read"
        )
    yield VARIABLES["flags"]._replace(equation="state")


SIMULATION_VARIABLES: dict[str, Variable] = {variable.name: variable for variable in _declared()}
"""Every variable of a simulation by name, `time` first."""
