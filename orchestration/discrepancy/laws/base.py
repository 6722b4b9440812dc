"""Basis of fits of corrections of laws: the search of a diagnosis, and its known effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fmus.kit import Effect
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import sampling_of, signal_scales
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.selection import Search
from orchestration.fmu.model import catalogue, families
from orchestration.records.runs import base_name


def search_of(
    diagnosis: Diagnosis,
    progress: Callable[[str], None] = lambda text: None,
    budget: Budget | None = None,
) -> Search:
    """Return a search over the estimation data of a diagnosis, for the parameters of its base."""
    base = diagnosis.selection.base
    problem = base.problem
    names = list(dict.fromkeys(map(base_name, problem.names)))
    known = {p.name for p in base.candidate.cls.layout.parameters}
    fixed = {n: v for n, v in problem.start.items() if n in known and n not in names}
    start = {n: v for n, v in problem.start.items() if n in names}
    several = (
        base_name(n) for n in problem.names if base_name(n) != n and not problem.declared[n].starts
    )
    search = Search(diagnosis.estimation, base.candidate.cls, names, fixed | start, progress)
    each = list(dict.fromkeys(several))
    return replace(search, each=each, budget=budget or Budget())


def effects_of(diagnosis: Diagnosis) -> list[type[Effect]]:
    """Return the catalogue of a diagnosed model, and the families that are made for its record."""
    search = search_of(diagnosis)
    cls = search.base
    data = diagnosis.usable
    scales = signal_scales(cls, data.time, data.inputs, search.fixed)
    made = families(cls, scales, sampling_of(data.time))
    return [*catalogue(cls).values(), *made.values()]
