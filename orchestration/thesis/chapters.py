"""All chapters together."""

from __future__ import annotations

from functools import cache

from orchestration.thesis import (
    actuator,
    analyser,
    degradation,
    foot,
    force_loop,
    forgetting,
    identification,
    work_loops,
)
from orchestration.thesis.claim import Claim, Erratum, Illustration

CHAPTERS = {
    "Chapter 2: the bench": (analyser, force_loop),
    "Chapters 1 and 3: the actuator": (actuator, identification),
    "Chapter 4: degradation": (forgetting, degradation),
    "Chapter 5: the foot": (foot, work_loops),
}


@cache
def findings() -> dict[str, tuple[Claim | Erratum, ...]]:
    """Everything that is found, by chapter."""
    return {title: tuple(f for part in parts for f in part.findings()) for title, parts in CHAPTERS.items()}


def claims() -> dict[str, list[Claim]]:
    """Figures and statements with what the computation gives, by chapter."""
    return {title: [f for f in found if isinstance(f, Claim)] for title, found in findings().items()}


def errata() -> list[Erratum]:
    """Rows of the errata page, by number."""
    every = (f for found in findings().values() for f in found if isinstance(f, Erratum))
    return sorted(every, key=lambda e: e.number)


def illustrations() -> dict[str, list[Illustration]]:
    """Figures by chapter."""
    return {title: [i for part in parts for i in part.illustrations()] for title, parts in CHAPTERS.items()}
