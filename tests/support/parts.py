"""A part of the suite: the tests whose names fall into it, so that several runs make the whole.

``PPY_PART=2/5`` runs the second of five parts. What a module tests with the same parameters is one
part's, as it may share a costly fixture; which one is decided by a checksum of both names, on every
machine and whatever else is selected.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from zlib import crc32

import pytest

VARIABLE = "PPY_PART"


def parse_part(text: str) -> tuple[int, int]:
    """Return the number of a part, from 1, and the number of parts.

    Raises
    ------
    pytest.UsageError
        If the text is not such as ``2/5``.
    """
    numbers = re.fullmatch(r"(\d+)/(\d+)", text)
    part, parts = map(int, numbers.groups()) if numbers else (0, 0)
    if not 1 <= part <= parts:
        raise pytest.UsageError(f"{VARIABLE}={text}: a part and the number of parts, such as 2/5")
    return part, parts


def is_in_part(nodeid: str, part: int, parts: int) -> bool:
    """Return whether a test belongs to a part."""
    module, _, test = nodeid.partition("::")
    parameters = test.partition("[")[2]
    return crc32(f"{module}[{parameters}".encode()) % parts == part - 1


def split(items: Sequence[pytest.Item], text: str) -> tuple[list[pytest.Item], list[pytest.Item]]:
    """Return the tests of a part, and the others."""
    part, parts = parse_part(text)
    chosen = [item for item in items if is_in_part(item.nodeid, part, parts)]
    return chosen, [item for item in items if not is_in_part(item.nodeid, part, parts)]
