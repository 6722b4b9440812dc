"""The floor of a search: every plain term alone, fitted from nominal, the best by information.

It uses the fits of the engine and knows nothing of how it searches, joins and compares.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis import (
    Shape,
    Subject,
    Term,
    fit,
    nominal_point,
    scale_of_signal,
    weights_of,
)

_STEPS = 12  # of a fit
_PLAIN = (Shape.LINEAR, Shape.ODD_SQUARE, Shape.DRY)


def best_plain_term(subject: Subject) -> Term | None:
    """Return the plain term of the least information criterion; None if none lowers it."""
    problem = subject.problem
    weights = weights_of(subject.base.errors)
    best, answer = 0.0, None
    for term in _plain_terms(subject):
        fitted = fit(problem, (term,), [nominal_point(problem, (term,))], weights, _STEPS)
        if fitted is None:
            continue
        effective = np.sum([w * len(e) for w, e in zip(weights, fitted.errors, strict=True)])
        gain = subject.base.cost - fitted.cost - 0.5 * term.freedom * np.log(effective + 3.0)
        if gain > best:
            best, answer = float(gain), term
    return answer


def _plain_terms(subject: Subject) -> Iterator[Term]:
    """Yield a constant and every plain function of an input or a state, of every law."""
    problem = subject.problem
    model, record = problem.model, problem.records[0]
    setting = problem.setting(subject.base.point, ())
    course = model.run(record, setting, subject.base.point.starts[0])
    assert course is not None, "the base ran before"
    laws = model.linearise(record, setting, course).laws
    names = [v.name for v in (*model.inputs, *model.states)]
    seen = dict(zip(names, np.column_stack([record.inputs, course.states]).T, strict=True))
    outputs = {o.name for o in model.outputs}
    for law, values in zip(model.laws, laws.T, strict=True):
        if law in outputs or model.perturbed.is_definition(law):
            continue
        size = _size(values)
        yield Term(law, "", Shape.CONSTANT, size=size)
        for name, signal in seen.items():
            scale, middle = scale_of_signal(signal)
            for shape in _PLAIN:
                yield Term(
                    law, name, shape, size=size, scale=scale or 1.0, middle=middle, width=0.3
                )


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) or 1.0
