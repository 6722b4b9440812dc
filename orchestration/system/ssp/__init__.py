"""Systems as files of SSP 1.0: archives ``.ssp`` with the FMUs in them, and bare ``.ssd`` descriptions beside them."""

from __future__ import annotations

from orchestration.system.ssp.reading import read
from orchestration.system.ssp.writing import write

__all__ = ["read", "write"]
