"""Claims: five parts of the suite are disjoint and together everything, about equally large, what a
module tests with the same parameters is in one of them, and a part is chosen by a variable, of
which anything else is refused in a line.
"""

from __future__ import annotations

import subprocess
import sys
from collections import Counter

import pytest

from tests.support.parts import VARIABLE, is_in_part, parse_part

REFUSED = ["", "0/5", "6/5", "2", "a/b", "2/5/1"]
NAMES = [
    f"tests/unit/test_{a}.py::test_{b}[{c}]" for a in range(30) for b in "ab" for c in range(10)
]


def test_every_test_is_in_one_part_with_those_that_share_its_parameters():
    parts = {name: [part for part in range(1, 6) if is_in_part(name, part, 5)] for name in NAMES}
    assert all(len(numbers) == 1 for numbers in parts.values())
    assert all(parts[name] == parts[name.replace("test_a[", "test_b[")] for name in NAMES)


def test_parts_are_about_equally_large():
    sizes = Counter(part for name in NAMES for part in range(1, 6) if is_in_part(name, part, 5))
    assert all(0.6 < size / (len(NAMES) / 5) < 1.4 for size in sizes.values())


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_part_is_refused(text):
    with pytest.raises(pytest.UsageError, match=f"{VARIABLE}={text}: a part and the number"):
        parse_part(text)


def test_a_run_of_a_part_collects_its_tests_alone(monkeypatch):
    monkeypatch.setenv(VARIABLE, "1/2")
    command = [sys.executable, "-m", "pytest", "--collect-only", __file__]
    output = subprocess.run(command, capture_output=True, text=True).stdout
    collected = {line for line in output.splitlines() if "::" in line}
    refusal = test_what_is_no_part_is_refused.__name__
    tests = [name for name in globals() if name.startswith("test_") and name != refusal]
    tests += [f"{refusal}[{text}]" for text in REFUSED]
    names = [f"tests/end_to_end/test_parts.py::{test}" for test in tests]
    expected = {name for name in names if is_in_part(name, 1, 2)}
    assert 0 < len(expected) < len(names)
    assert collected == expected
