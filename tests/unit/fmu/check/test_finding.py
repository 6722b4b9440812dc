"""Claims: a message lists a few names, and of many how many more there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from orchestration.fmu import check
from orchestration.fmu.check.finding import _CODES, RULES, Finding, listed


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (0, ""),
        (1, "n1"),
        (8, "n1, n2, n3, n4, n5, n6, n7, n8"),
        (9, "n1, n2, n3, n4, n5, n6, n7, n8 and 1 more"),
        (20, "n1, n2, n3, n4, n5, n6, n7, n8 and 12 more"),
    ],
)
def test_of_many_names_the_first_eight_are_listed(count, expected):
    assert listed(f"n{k}" for k in range(1, count + 1)) == expected


def test_every_code_is_of_one_rule_and_every_rule_is_checked():
    """A code that is mistyped would fail only in front of a user."""
    folder = Path(check.__file__).parent
    sources = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.py"))
    listed_codes = " ".join(_CODES.values()).split()
    assert sorted(listed_codes) == sorted(RULES)
    made = set(re.findall(r'Finding\(\s*"([a-z-]+)"', sources))
    made |= {"no-binaries", "sources-only", "binary-variable", "structural-parameter"}
    assert made == set(RULES)


def test_line_and_severity_follow_from_the_code():
    finding = Finding("no-unit", "no unit for u", ("u",))
    assert (finding.line, finding.severity) == (2, "warning")
