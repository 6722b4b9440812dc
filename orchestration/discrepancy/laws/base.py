"""What laws are asked of: the searches and the data of a diagnosed model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.selection.search import Search
from orchestration.records.joined import base_name


def search_of(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> Search:
    """Fits of models over the estimation data of a diagnosis, that search what its base was searched for."""
    problem, base = diagnosis.selection.base.problem, diagnosis.selection.base
    names = list(dict.fromkeys(map(base_name, problem.names)))
    known = {p.name for p in base.candidate.cls.layout.parameters}
    fixed = {n: v for n, v in problem.start.items() if n in known and n not in names}
    start = {n: v for n, v in problem.start.items() if n in names}
    several = (
        base_name(n) for n in problem.names if base_name(n) != n and not problem.declared[n].starts
    )
    search = Search(diagnosis.estimation, base.candidate.cls, names, fixed | start, progress)
    return replace(search, each=list(dict.fromkeys(several)))


def usable(diagnosis: Diagnosis) -> Dataset:
    """All that was measured and the final model of a diagnosis was fitted to."""
    problem = diagnosis.final.problem
    several = problem.runs if len(problem.runs) > 1 else ()
    return Dataset(
        problem.time, problem.inputs, problem.measured, diagnosis.estimation.linear, several
    )
