"""Variables of a simulation: simulated ones under the names of results, commands, errors and readings."""

from __future__ import annotations

from collections.abc import Iterator

from vsacli.base.variables import VARIABLES, Variable

TRACKED = ("q", "dq", "ddq", "stiffness", "dstiffness")
"""Variables that the trajectory commands and from which a simulation deviates."""

SIMULATED = (
    *TRACKED,
    *("tau_e", "phi", "dphi", "theta", "dtheta", "tau_transmission", "tau_motor"),
    *("elastic_energy", "motor_power", "motor_energy", "det_A"),
    *("damping", "tau_damper"),
    *("dissipated_power", "current", "voltage", "copper_loss"),
)
COMMANDS = {**{name: f"{name}_ref" for name in TRACKED}, "tau_motor": "tau_motor_cmd"}
"""Name of the command for a simulated variable: the reference, or the torque that the controller outputs."""

ERRORS = ("q", "dq", "stiffness", "dstiffness")
MEASURED = ("q", "theta", "tau_motor")
"""Variables that sensors read."""


def measured(name: str) -> str:
    """Return the name under which the measured value of a variable is stored."""
    return f"{name}_measured"


def error(name: str) -> str:
    """Return the name under which the error of a variable is stored, simulated minus commanded."""
    return f"{name}_error"


SIMULATED_NAMES = {
    **{command: name for name, command in COMMANDS.items()},
    **{measured(name): name for name in MEASURED},
}
"""Name of the simulated variable for a command or reading, which has the same limits and plots."""


def _declared() -> Iterator[Variable]:
    yield VARIABLES["time"]
    words = {name: VARIABLES[name].long_name.replace("commanded ", "") for name in SIMULATED}
    for name in SIMULATED:
        yield VARIABLES[name]._replace(long_name=words[name], equation="(5)")
    for name in TRACKED:
        yield VARIABLES[name]._replace(name=COMMANDS[name])
    yield VARIABLES["tau_motor"]._replace(
        name=COMMANDS["tau_motor"],
        long_name="motor torque commanded by the controller, joint side of the gear",
        equation="controller",
    )
    for name in ERRORS:
        yield VARIABLES[name]._replace(
            name=error(name),
            long_name=f"{words[name]}, simulated minus commanded",
            equation=f"{name} - {COMMANDS[name]}",
        )
    for name in MEASURED:
        yield VARIABLES[name]._replace(
            name=measured(name), long_name=f"{words[name]}, as measured", equation=f"sensor reading of {name}"
        )
    yield VARIABLES["flags"]._replace(equation="state")


SIMULATION_VARIABLES: dict[str, Variable] = {variable.name: variable for variable in _declared()}
"""All variables of a simulation by name, `time` first."""
