"""Mends scene files: what would spoil a bake and can go without changing the look."""

from baker.mending.mend import Mended, MendSettings, mend_file
from baker.mending.write import check_fixed, write_fixed

__all__ = ["MendSettings", "Mended", "check_fixed", "mend_file", "write_fixed"]
