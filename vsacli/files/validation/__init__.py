"""Everything that is wrong with files of any kind."""

from vsacli.files.validation.check import check_files
from vsacli.files.validation.finding import Checked, Finding

__all__ = ["Checked", "Finding", "check_files"]
