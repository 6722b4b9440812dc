"""Claims: answers about misused records are classed by what they say of the fault."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

import orchestration as ppy
from fmus.kit import UserError
from studies.judging import misuse
from studies.misuse import MisuseCase


@pytest.mark.parametrize(
    ("kind", "outcome"),
    [
        ("speed in rpm", misuse.NAMED),
        ("input of the other sign", misuse.NAMED),
    ],
)
def test_a_fault_of_a_motor_is_classed(kind, outcome):
    row = misuse.judge(MisuseCase(kind, "Motor", "square", 3))
    assert row["outcome"] == outcome
    assert row["kind"] == kind
    text = str(misuse.report([row]))
    assert kind in text


def test_what_is_refused_is_told_so(monkeypatch):
    def refuse(*arguments, **options):
        raise UserError("too short")

    monkeypatch.setattr(ppy, "diagnose", refuse)
    row = misuse.judge(MisuseCase("too short", "Motor", "square", 3))
    assert (row["outcome"], row["said"]) == (misuse.REFUSED, "too short")


@dataclass(frozen=True)
class Told:
    """A reading of columns, a cause, or an answer, as the engine gives them."""

    columns: tuple[str, ...] = ()
    instead: tuple[Told, ...] = ()
    reading: Told | None = None
    causes: tuple[Told, ...] = ()
    notes: tuple[tuple[str, str, str], ...] = ()
    verdict: str = "consistent"

    @property
    def is_named(self) -> bool:
        return self.verdict in ("cause", "ambiguous")


RIGHT = Told(reading=Told(("speed",)))
INSTEAD = Told(reading=Told(("voltage",), (Told(("speed",)),)))
WRONG = Told(reading=Told(("voltage",)))
CLIPPED = (("clipped", "speed", "cut off"),)
COARSE = (("quantised", "speed", "coarse"),)


@pytest.mark.parametrize(
    ("told", "outcome"),
    [
        (Told(verdict="cause", causes=(RIGHT,)), misuse.NAMED),
        (Told(verdict="ambiguous", causes=(WRONG, INSTEAD)), misuse.NAMED),
        (Told(verdict="cause", causes=(WRONG,)), misuse.MISLED),
        (Told(verdict="cause", causes=(Told(),), notes=CLIPPED), misuse.MISLED),
        (Told(verdict="recalibrate", notes=CLIPPED), misuse.NAMED),
        (Told(verdict="consistent", notes=COARSE), misuse.MISLED),
        (Told(verdict="unexplained", notes=CLIPPED), misuse.NAMED),
        (Told(verdict="unexplained", causes=(RIGHT,)), misuse.IN_GENERAL),
        (Told(verdict="unexplained", causes=(WRONG,)), misuse.SILENT),
    ],
)
def test_answers_are_classed_by_readings_and_notes(told, outcome):
    assert misuse._outcome("saturated", told, {"speed"}) == outcome


def test_what_misleads_is_counted_and_shown():
    case = {"kind": "integrated", "plant": "Motor", "stimulus": "square", "seed": 1}
    rows = [
        case | {"outcome": misuse.MISLED, "said": "a lag"},
        case | {"outcome": misuse.NAMED, "said": "integrated"},
    ]
    text = str(misuse.report(rows))
    assert "a lag" in text
    assert "50" in text


def test_the_command_line_keeps_rows_and_writes_a_page(tmp_path):
    page = tmp_path / "page.md"
    kept = tmp_path / "kept.jsonl"
    arguments = ["--each", "1", "--seed", "2", "--only", "too short", "--kept", str(kept)]
    misuse.STUDY.main([*arguments, "--out", str(page)])
    assert len(kept.read_text().splitlines()) == 1
    assert "Misused records" in page.read_text()
