"""Corrections of a motor's friction, made by hand, and the report that one of them is in."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from fmus.kit import stack
from fmus.kit.corrections import SignalTerm, correction
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import Basis, Curve
from orchestration.discrepancy.laws.signals import LawSignal
from orchestration.discrepancy.report.laws.law_report import LawReport
from studies.plants.models.motor import Motor

ENDS = np.array([-40.0, 95.0])
KNOTS = np.linspace(*ENDS, 7)


def entry(law: str = "friction", signal: str = "omega", kind: str = "add", memory: str = ""):
    """Return an entry of the map, whose curve is 0.01 times its signal."""
    nothing = np.zeros((len(KNOTS), len(KNOTS)))
    curve = Curve(12.0, 0.01 * KNOTS, nothing, nothing, 0.0)
    lag = 0.7 if memory == "lagged" else 0.0
    direction, step = np.ones(1), np.zeros(2)
    signal_with_memory = LawSignal(signal, memory, lag)
    basis = Basis(KNOTS)
    return Entry(law, law, signal_with_memory, kind, basis, curve, direction, step, 0.0, ENDS)


def motor_report(shape: str, kind: str = "add", amount: float = 0.01, width: float = 2.0):
    """Return a report with one correction, of friction over speed, and that correction."""
    signal = SignalTerm("omega", "", 0.0, "rad/s", 100.0, 0.0)
    effect = correction(Motor, "friction", signal, shape, "N*m", 0.01, kind=kind)
    values = {effect.neutral: amount, f"{effect.neutral}_width": width}
    model = SimpleNamespace(
        effect=effect,
        effect_name="friction(omega)",
        candidate=SimpleNamespace(cls=stack(Motor, effect), effects=()),
        parameters=values,
    )
    of_map = entry(kind=kind)
    band = (of_map.curve.values, of_map.curve.values - 0.1, of_map.curve.values + 0.1)
    one = SimpleNamespace(
        entry=of_map,
        model=model,
        shape=shape,
        gain=12.0,
        band=band,
        band_at=lambda x: (0.01 * x, 0.01 * x - 0.1, 0.01 * x + 0.1),
        alike=(of_map, entry("drop", "current")),
        confirmation=None,
        confirmed=True,
        errors=({}, {}),
        relaxation=False,
    )
    base = SimpleNamespace(candidate=SimpleNamespace(cls=Motor, effects=()))
    found = SimpleNamespace(base=base, corrections=[one], entries=[of_map], chance=3.0)
    laws = SimpleNamespace(found=found, noise={}, cause=None, beside=None)
    return LawReport(None, laws), one
