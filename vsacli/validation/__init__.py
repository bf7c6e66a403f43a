"""Everything that is wrong with files of any kind."""

from vsacli.validation.check import check_files
from vsacli.validation.finding import Checked, Finding

__all__ = ["Checked", "Finding", "check_files"]
