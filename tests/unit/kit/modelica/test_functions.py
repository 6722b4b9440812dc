"""Claims: functions compute what their comments say, and cause no events."""

import math

import pytest
import rumoca

from fmus.kit.modelica.functions import function_classes


def values(expression, times):
    package = "\n".join(["package Functions", *function_classes().values(), "end Functions;"])
    model = f"model M Real y; equation y = {expression}; end M;"
    compiled = rumoca.Session().loads(f"{package}\n{model}", model="M")
    result = compiled.simulate(t=(0.0, times[-1]), dt=times[1])
    assert len(result.time) == len(times), "an event"
    return list(result["y"])


TIMES = [0.4 * k for k in range(11)]


def test_rounding():
    down = values("Functions.roundedDown(time - 2.0)", TIMES)
    up = values("Functions.roundedUp(time - 2.0)", TIMES)
    assert down == pytest.approx([math.floor(t - 2.0) for t in TIMES])
    assert up == pytest.approx([math.ceil(t - 2.0) for t in TIMES])


def test_the_hypotenuse_does_not_overflow_and_may_be_zero():
    computed = values("Functions.hypotenuse(3e200 * time, -4e200 * time)", TIMES)
    assert computed == pytest.approx([5e200 * t for t in TIMES], rel=1e-15)
    assert values("Functions.hypotenuse(0.0, 0.0)", TIMES) == [0.0] * len(TIMES)
