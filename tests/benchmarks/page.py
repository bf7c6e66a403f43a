"""The figures as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from actuation import JOINTS, Actuation
from commands import Taken
from compiled import Cost
from controllers import Controller
from growth import SAMPLES_OF_CHAIN, Growth
from kernel import CASADI, Kernel
from machine import processor
from markdown import table
from one_sample import PEER
from optimizations import PEER as IPOPT
from optimizations import VSACLI, Optimized
from recorders import Recorder
from sensitivities import INVERSE_DYNAMICS, SAMPLES, Sensitivities
from simulations import COMPILED, RECORDED, TEXT, Simulated
from single_calls import CALLS, SCALAR_FLAGS, Calls
from stages import Stages
from storage import Stored
from timing import Seconds
from variants import VariantTime
from waits import Wait
from whole_runs import WholeRun


def micro(seconds: float) -> str:
    """Microseconds, two digits."""
    return f"{seconds * 1e6:.2g}"


def kernel_table(kernels: Iterable[Kernel]) -> str:
    """The ways to the link torques, against casadi."""
    kernels = list(kernels)
    peer = next(kernel.seconds for kernel in kernels if kernel.name == CASADI)
    header = ("tau_e, dtau_e, ddtau_e of the 7R arm", "µs a sample", "ratio", "largest difference")
    return table(
        header, ([k.name, micro(k.seconds), f"{k.seconds / peer:.2g}", _differences(k)] for k in kernels)
    )


def _differences(kernel: Kernel) -> str:
    return "-" if kernel.differences is None else ", ".join(f"{error:.0e}" for error in kernel.differences)


def batch_table(taken: Seconds) -> str:
    """Compiled batches, against casadi."""
    header = ("7R arm, compiled", "threads", "µs a sample", "ratio")
    rows = [
        [*_way(name), micro(seconds), f"{seconds / taken[CASADI]:.2g}"] for name, seconds in taken.items()
    ]
    return table(header, rows)


def variant_table(ways: Iterable[VariantTime]) -> str:
    """Variants of the arm a second, with what each way computes."""
    header = ("7R arm, variants of 201 samples", "results", "variants a second")
    return table(header, ([way.name, way.content, f"{float(f'{way.rate:.2g}'):,.0f}"] for way in ways))


def _way(name: str) -> list[str]:
    return [name, "1"] if name == CASADI else name.rsplit(", ", 1)


def subnormal_table(ratios: Mapping[str, Seconds]) -> str:
    """What small numbers cost, by engine and size."""
    header = ("derivatives times", *ratios)
    sizes = next(iter(ratios.values()))
    return table(header, ([size, *(f"{taken[size]:.2f}" for taken in ratios.values())] for size in sizes))


def sample_part(seconds: Seconds, recording: float, first: float) -> str:
    """What single samples cost from Python, and recording a robot; `first` is that of the control law."""
    peer = seconds[PEER]
    rows = table(
        ("one sample, 7R arm", "ms", "ratio"),
        ([name, f"{1e3 * taken:.2g}", f"{taken / peer:.2g}"] for name, taken in seconds.items()),
    )
    return (
        f"{rows}\n\nThe call of `motor_torques` that records the robot takes {recording:.2g} s, the first of "
        f"`FeedbackLinearization` {first:.2g} s. {measured_on()}"
    )


def measured_on() -> str:
    """The processor, for parts that are not measured together with the others."""
    return f"Measured on {processor()}."


def call_sentence(calls: Calls) -> str:
    """How long single calls of generated code take."""
    return (
        f"{CALLS:,} single calls of the generated `inverse_dynamics`, 7R arm, "
        f"`{' '.join(SCALAR_FLAGS)}`: median {calls.median:.2g} µs, 99.9 % below {calls.most:.2g} µs, "
        f"the worst {calls.worst:,.0f} µs, when the operating system let something else run."
    )


def controller_table(found: Iterable[Controller]) -> str:
    """Memory, operations and time of inverse dynamics on controllers."""
    names = ("robot", "numbers", "operations at most", "flash", "stack")
    header = (*names, "instructions a call", "the longest", "µs here")
    return table(
        header,
        (
            [
                f"`{each.robot}`",
                each.precision,
                f"{each.operations:,}",
                f"{each.flash / 1e3:.0f} kB",
                f"{each.stack / 1e3:.1f} kB",
                f"{each.instructions:,.0f}",
                f"{each.most:,.0f}",
                micro(each.seconds),
            ]
            for each in found
        ),
    )


def cost_table(costs: Mapping[int, Cost]) -> str:
    """Size of the code, and the time that it takes to make it."""
    header = ("joints", "operations", "code", "stack", "recording", "compiling")
    return table(
        header,
        (
            [
                str(joints),
                f"{cost.operations:,}",
                f"{cost.code / 1e3:.0f} kB",
                f"{cost.stack / 1e3:.1f} kB",
                f"{cost.recording:.2f} s",
                f"{cost.compiling:.1f} s",
            ]
            for joints, cost in costs.items()
        ),
    )


def recorder_table(recorders: Iterable[Recorder]) -> str:
    """What recording by vsacli and by casadi leaves."""
    header = ("tau_e, dtau_e, ddtau_e", "operations", "C", "code", "compiling", "µs a call", "installed")
    return table(
        header,
        (
            [
                each.name,
                f"{each.operations:,}",
                f"{each.source / 1e3:.0f} kB",
                f"{each.code / 1e3:.0f} kB",
                f"{each.compiling:.1f} s",
                micro(each.seconds),
                f"{each.installed / 1e6:.3g} MB",
            ]
            for each in recorders
        ),
    )


def stage_table(numpy: Stages, compiled: Stages) -> str:
    """The stages of a run, with either engine."""
    rows = (
        [name.replace("_", " "), micro(by_numpy), micro(by_code)]
        for name, by_numpy, by_code in zip(Stages._fields, numpy, compiled, strict=True)
    )
    return table(("stage, µs a sample of the 7R arm", "NumPy", "compiled, 1 thread"), rows)


def storage_table(found: Mapping[str, Mapping[str, Stored]]) -> str:
    """Ways to store results, on each subject."""
    ways = next(iter(found.values()))
    header = ("stored as", *(f"{subject}: µs to write, to read, bytes" for subject in found))
    return table(header, ([way, *(_cell(by_way[way]) for by_way in found.values())] for way in ways))


def _cell(stored: Stored) -> str:
    return f"{micro(stored.write)}, {micro(stored.read)}, {stored.size:.0f}"


def whole_table(runs: Iterable[WholeRun]) -> str:
    """Whole runs, against casadi's link torques."""
    clock = "by the clock, one processor", "two"
    header = ("7R arm, stored", "µs of processors a sample", "over casadi", *clock, "one over two")
    rows = (
        [
            run.stored,
            micro(run.seconds),
            f"{run.ratio:.2g}",
            *map(micro, run.by_clock),
            f"{run.by_clock[0] / run.by_clock[1]:.2g}",
        ]
        for run in runs
    )
    return f"{table(header, rows)}\n\n{measured_on()}"


def sensitivity_part(found: Sensitivities) -> str:
    """All derivatives, against one run without them, and the memory they take."""
    header = (f"7R arm, {SAMPLES:,} samples, {found.numbers} numbers", "ms", "ratio")
    unit = found.seconds[INVERSE_DYNAMICS]
    rows = [[name, f"{taken * 1e3:.0f}", f"{taken / unit:.2g}"] for name, taken in found.seconds.items()]
    memory = ", ".join(f"{most / 1e6:.0f} MB for {joints} joints" for joints, most in found.memory.items())
    return f"{table(header, rows)}\n\nAt most resident: {memory}.\n"


def actuation_table(found: Iterable[Actuation]) -> str:
    """The springs, against the recursion."""
    header = ("springs", "load", "µs a joint and sample", f"of the recursion ({JOINTS} joints)")
    return table(header, ([a.springs, a.load, micro(a.seconds), f"{a.ratio:.2g}"] for a in found))


def simulation_table(found: Iterable[Simulated]) -> str:
    """Simulations with each way to evaluate the equations of motion."""
    ways = [f"{way}, s" for way in (TEXT, RECORDED, COMPILED)]
    return table(
        ("simulation", "of", "evaluations", *ways, "ratio", "µs an evaluation", "with compiling, s"),
        (
            [
                each.name,
                f"{each.duration:g} s",
                f"{each.evaluations:,}",
                *(f"{each.seconds[way]:.2g}" for way in (TEXT, RECORDED, COMPILED)),
                f"{each.seconds[TEXT] / each.seconds[COMPILED]:.2g}",
                micro(each.seconds[COMPILED] / each.evaluations),
                f"{each.first:.2g}",
            ]
            for each in found
        ),
    )


def search_table(found: Iterable[Optimized]) -> str:
    """Searches for the best stiffness, against IPOPT."""
    return table(
        ("stiffness of least torque", f"{VSACLI}, s", f"{IPOPT}, s", "ratio", "rms torques, N m", "of IPOPT"),
        (
            [
                each.name,
                *(f"{each.seconds[way]:.2g}" for way in (VSACLI, IPOPT)),
                f"{each.seconds[VSACLI] / each.seconds[IPOPT]:.2g}",
                *(", ".join(f"{cost:.5g}" for cost in each.costs[way]) for way in (VSACLI, IPOPT)),
            ]
            for each in found
        ),
    )


def startup_table(taken: Seconds) -> str:
    """The commands, against the imports they need."""
    of = {"vsacli --help": "import click", "the paper's job": "import numpy, h5py, yaml, click"}
    rows = (
        [
            f"`{name}`" if name not in ("the paper's job",) else name,
            f"{seconds * 1e3:.0f}",
            f"{seconds / taken[of[name]]:.2f} of `{of[name]}`" if name in of else "",
        ]
        for name, seconds in taken.items()
    )
    return f"{table(('command', 'ms', 'ratio'), rows)}\n\n{measured_on()}"


def memory_sentence(samples: int, memory: int) -> str:
    """What a long run takes at most."""
    most = f"at most {memory / 1e6:.0f} MB resident"
    return f"{samples:,} samples with `--variables tau_motor,flags`: {most}."


def growth_tables(growth: Growth) -> str:
    """Whole runs, over samples and over joints."""
    header = ("NumPy", "memory", "compiled", "memory")
    arms, chains = (
        table((what, *header), ([f"{number:,}", *_both(found, number)] for number in found["numpy"]))
        for what, found in (("samples, 7R arm", growth.by_samples), ("joints", growth.by_joints))
    )
    return f"{arms}\n\nChains, {SAMPLES_OF_CHAIN:,} samples, all variables:\n\n{chains}"


def _both(found: Mapping[str, Mapping[int, Taken]], number: int) -> Iterable[str]:
    for by_number in found.values():
        each = by_number[number]
        yield from (f"{each.seconds:.2g} s", f"{each.memory / 1e6:.0f} MB")


def waits_table(waits: Iterable[Wait]) -> str:
    """Processor time, the clock, and memory of commands."""
    rows = (
        (name, f"{found.processor:.2g}", f"{found.seconds:.2g}", f"{found.memory / 1e6:.0f}")
        for name, found in waits
    )
    return table(("command", "processor time, s", "by the clock, s", "MB"), rows)
