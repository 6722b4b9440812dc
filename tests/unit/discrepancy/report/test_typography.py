"""Effects and values as a page prints them."""

from __future__ import annotations

import pytest

from fmus import COMPONENTS, component
from orchestration.discrepancy.candidates.candidate import catalogue
from orchestration.discrepancy.report import typography
from orchestration.fmu import model as models


def test_every_effect_is_described():
    for name in COMPONENTS:
        cls = component(name)
        for effect in catalogue(cls, models.catalogue(cls), [o.name for o in cls.layout.outputs]):
            text = typography.does(effect)
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
    assert typography.pretty(plain) == printed
