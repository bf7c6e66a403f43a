"""Studies beyond a run: fixes, optimization, sensitivity, identification, sizing, sweeps, comparison."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.studies.identification import Identification, identify
    from vsacli.studies.identification.excitation import Excitation, excitation_text, plan_excitation
    from vsacli.studies.measured import Comparison, compare
    from vsacli.studies.search import Optimum, fixes, optimize
    from vsacli.studies.sensitivities import Sensitivity, sensitivity
    from vsacli.studies.sizing import Sizing, size_drives
    from vsacli.studies.sweeps import StudySummary, run_study

__all__ = [
    "Comparison",
    "Excitation",
    "Identification",
    "Optimum",
    "Sensitivity",
    "Sizing",
    "StudySummary",
    "compare",
    "excitation_text",
    "fixes",
    "identify",
    "optimize",
    "plan_excitation",
    "run_study",
    "sensitivity",
    "size_drives",
]
__getattr__, __dir__ = lazy_exports(__name__)
