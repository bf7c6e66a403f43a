"""What a report says of energy."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from vsacli.analysis.report_text import number
from vsacli.base.units import TORQUE
from vsacli.dynamics.energy import JointEnergy


def energy_lines(joints: Sequence[tuple[str, str, JointEnergy]]) -> Iterator[str]:
    """From names, types and energies of joints: sums, if all have them, and the joints with the most."""
    energies = [energy for _, _, energy in joints]
    if not any(math.isnan(energy.spent) for energy in energies):
        spent, recovered = (
            number(sum(each)) for each in zip(*((e.spent, e.recovered) for e in energies), strict=True)
        )
        name, _, most = max(joints, key=lambda joint: joint[2].elastic_peak)
        held = f"; springs hold up to {number(most.elastic_peak)} J ({name})" if most.elastic_peak else ""
        yield f"energy: motors spend {spent} J, take back {recovered} J{held}"
        yield from _losses(energies)
    paired = [joint for joint in joints if not math.isnan(joint[2].co_contraction)]
    if paired:
        name, joint_type, most = max(paired, key=lambda joint: joint[2].co_contraction)
        unit = TORQUE.unit(joint_type)
        effort, load = f"{number(most.co_contraction)} {unit}", f"{number(most.load)} {unit}"
        yield f"co-contraction: up to {effort} rms for each motor ({name}), its load takes {load}"


def _losses(energies: Sequence[JointEnergy]) -> Iterator[str]:
    """What friction and windings take, of a robot whose file says so."""
    taken = {
        "friction and damping take {} J": [energy.dissipated for energy in energies],
        "the windings turn {} J into heat": [energy.copper_loss for energy in energies],
    }
    known = {words: [loss for loss in losses if loss is not None] for words, losses in taken.items()}
    sums = [words.format(number(sum(losses))) for words, losses in known.items() if losses]
    if sums:
        yield "losses: " + ", ".join(sums)
