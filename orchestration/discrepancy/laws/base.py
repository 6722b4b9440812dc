"""The search over a diagnosis's estimation data, with which corrections of laws are fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.selection import Search
from orchestration.records import base_name


def search_of(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> Search:
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
    return replace(search, each=list(dict.fromkeys(several)))
