"""Claims: a test of residuals is found by being in a module of the package."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from orchestration.discrepancy import residuals
from orchestration.discrepancy.residuals.residual_test import residual_tests

ONE_MORE = '''
from dataclasses import dataclass
from typing import ClassVar

from orchestration.discrepancy.residuals.residual_test import ResidualTest


@dataclass(frozen=True)
class Sign(ResidualTest):
    """More than half of the residual is positive."""

    p_value: float
    rms: float

    @classmethod
    def of(cls, residual):
        return [cls(0.0, 1.0)]

    def describe(self, output):
        return f"{output} is positive"
'''


def test_those_that_there_are_the_most_telling_first():
    assert [test.__name__ for test in residual_tests()] == [
        "RandomWalkTest",
        "ExcessVariance",
        "ConditionalMean",
        "CrossCorrelation",
    ]


def test_a_module_more_is_a_test_more_of_every_analysis(tmp_path: Path):
    """In a process of its own, as classes stay known."""
    (tmp_path / "sign.py").write_text(ONE_MORE, encoding="utf-8")
    code = (
        "from orchestration.discrepancy import residuals\n"
        f"residuals.__path__.append({str(tmp_path)!r})\n"
        "from tests.support.battery import analysed\n"
        "from tests.support.noises import clean, gaussian\n"
        "analysis = analysed(clean(3, gaussian()))\n"
        "print([test.describe('y') for test in analysis.structure])\n"
    )
    root = Path(residuals.__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "['y is positive']"
