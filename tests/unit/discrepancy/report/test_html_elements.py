"""Claims: intervals are drawn to scale, and numbers and effects are written as people read them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fmus import COMPONENTS, component
from orchestration.discrepancy.candidates.candidate import catalogue
from orchestration.discrepancy.report import html_elements
from orchestration.fmu import model as models
from orchestration.identify.uncertainty.estimate import Estimate
from orchestration.reporting.html import elements


def test_an_interval_is_drawn_to_scale():
    near, far = (Estimate(v, 1.0, (0.9 * v, 1.1 * v), "1") for v in (1.0, 2.0))
    scale = html_elements.AxisScale.covering([near, far])
    middle, off = (
        float(re.search(r'cx="([\d.]+)"', scale.draw_interval(e, False))[1]) for e in (near, far)
    )
    end = float(re.search(r'<svg width="(\d+)"', scale.header)[1])
    assert middle == end / 2
    assert (off - middle) / (end / 2) == pytest.approx(np.log(2.0) / scale.reach, abs=1e-3)
    assert middle < off < end
    assert scale.draw_interval(Estimate(1.0, 0.0, (0.0, 2.0), "1"), False) == ""


def test_every_effect_is_described():
    for name in COMPONENTS:
        cls = component(name)
        for effect in catalogue(cls, models.catalogue(cls), [o.name for o in cls.layout.outputs]):
            text = html_elements.effect_summary(cls, effect)
            assert len(text) > 20
            assert "`" not in text


@pytest.mark.parametrize(
    ("plain", "printed"),
    [
        ("2e+06 N*s/m", "2·10<sup>6</sup> N·s/m"),
        ("-1.5e-07 1/C^2", "−1.5·10<sup>−7</sup> 1/C<sup>2</sup>"),
        ("0.43 ohm", "0.43 ohm"),
        ("-8.0 %", "−8.0 %"),
        ("a<b", "a&lt;b"),
        ("kg*m^-1", "kg·m<sup>−1</sup>"),
    ],
)
def test_values_as_they_are_printed(plain, printed):
    assert elements.format_quantities(plain) == printed
