"""Claims: the file of a correction is short, can be imported, and computes what the fitted
correction computes.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import stack
from fmus.kit.corrections import KINDS, MEMORIES, SignalTerm, SmoothTable, correction
from fmus.kit.curves import SHAPES
from orchestration.discrepancy.laws.signals import LawSignal
from orchestration.discrepancy.report.laws.effect_file import FORMULAS, source
from studies.plants.models.motor import Motor

KNOTS, VALUES = (-80.0, -1.0, 0.0, 1.0, 90.0), (0.3, -0.2, 0.0, 0.15, -0.4)
CASES = [
    *(("friction", "omega", "", "add", shape) for shape in SHAPES),
    *(
        ("friction", "omega", memory, kind, shape)
        for memory in MEMORIES
        for kind in KINDS
        for shape in ("", "cubic")
    ),
    ("winding_current", "voltage", "lagged", "add", ""),
    ("winding_current", "friction", "", "multiply", "sign"),
    ("friction", "friction", "", "add", ""),
    ("friction", "friction", "throughput", "add", "linear"),
    ("friction", "time", "", "multiply", "linear"),
]


def fitted(law, signal, memory, kind, shape):
    """A correction of the motor with values as a fit would leave them, and where its file comes
    from.
    """
    of = SignalTerm(
        signal, memory, 0.7 if memory in ("lagged", "leading", "heat") else 0.0, "rad/s", 100.0, 3.0
    )
    table = SmoothTable(KNOTS, VALUES, fixed=True)
    effect = correction(Motor, law, of, shape or table, "N*m", 0.01, kind=kind)
    cls = stack(Motor, effect)
    values = {p.name: float(p.start) for p in cls.layout.parameters} | {
        "damping": 2.34e-4,
        "omega_start": 5.0,
    }
    values |= {
        effect.neutral: 0.017,
        f"{effect.neutral}_width": 12.5,
        f"{effect.neutral}_memory_constant": 0.9,
    }
    values = {n: v for n, v in values.items() if n in {p.name for p in cls.layout.parameters}}
    run = SimpleNamespace(values=dict)
    candidate = SimpleNamespace(cls=cls)
    problem = SimpleNamespace(runs=[run])
    entry = SimpleNamespace(law=law, signal=LawSignal(signal, memory, of.constant), kind=kind)
    model = SimpleNamespace(effect=effect, candidate=candidate, problem=problem, parameters=values)
    made = SimpleNamespace(entry=entry, model=model, shape=shape)
    law_report = SimpleNamespace(
        component=Motor, result=SimpleNamespace(files='a "quoted" \udcff.csv'), final_model=model
    )
    law_report.rounds = [SimpleNamespace(best=made, correction_values=lambda model: {})]
    return law_report, made, values


@pytest.mark.parametrize(("law", "signal", "memory", "kind", "shape"), CASES)
def test_the_file_computes_what_was_fitted(law, signal, memory, kind, shape):
    """The oracle is the effect that was fitted, in a component without any solver."""
    law_report, one, values = fitted(law, signal, memory, kind, shape)
    written: dict = {}
    text = source(law_report)
    exec(compile(text, "law.py", "exec"), written)
    (effect,) = (
        c for c in written.values() if isinstance(c, type) and c.__module__ != "fmus.kit.effects"
    )
    theirs, ours = (
        one.model.candidate.cls(**values),
        stack(Motor, effect, defaults=written["FITTED"])(),
    )
    rng = np.random.default_rng(1)
    for _ in range(20):
        state = {
            s.name: float(x)
            for s, x in zip(theirs.layout.states, rng.normal(0.0, 60.0, 9), strict=False)
        }
        now = state | {
            "voltage": float(rng.normal(0.0, 6.0)),
            "load": 0.01,
            "time": float(rng.uniform(0.0, 9.0)),
        }
        for component in (theirs, ours):
            for name, value in now.items():
                setattr(component, name, value)
        assert ours.rates() == pytest.approx(theirs.rates(), rel=1e-9)
        assert ours.outputs() == pytest.approx(theirs.outputs(), rel=1e-9)
    assert text.isascii()
    assert {s.name: float(s.start) for s in ours.layout.states} == pytest.approx(
        {s.name: values[theirs.layout.start_of[s.name]] for s in theirs.layout.states}
    )


def test_shapes_are_written_out():
    assert set(FORMULAS) == set(SHAPES)
    text = source(fitted("friction", "omega", "", "add", "odd_quadratic")[0])
    assert "self.friction_of_omega * (x * absolute(x))" in text
    assert "class FrictionOverOmega(Effect):" in text
    assert len(text.splitlines()) < 40
