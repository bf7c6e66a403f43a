"""Foundations of all other packages: errors, units, flags, variables, arrays, and atomic file output."""

from typing import TYPE_CHECKING

from vsacli.base.lazy import lazy_exports

if TYPE_CHECKING:
    from vsacli.base.errors import InputError, StorageError
    from vsacli.base.flags import Flag
    from vsacli.base.version import __version__
    from vsacli.base.wrench import Wrench

__all__ = [
    "Flag",
    "InputError",
    "StorageError",
    "Wrench",
    "__version__",
]
__getattr__, __dir__ = lazy_exports(__name__)
