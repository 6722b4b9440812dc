"""The bench closed over the actuator, as FMUs: whatever is fed to it or set in it, it runs on or
says why not.
"""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterator

import pytest

from fmus import component
from tests.contract.raw import ERROR, OK, Instance, doubles, instance

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="an FMU in use cannot be removed there"
)
BENCH, ACTUATOR = "voice_coil_dma", "ppy_actuator_length_driven"
STEP = 1e-3


class Loop:
    """Bench and actuator, exchanging position and tension every millisecond."""

    def __init__(self, bench: Instance, actuator: Instance):
        self.bench, self.actuator = bench, actuator

    def initialize(
        self, bench: dict[str, float] | None = None, actuator: dict[str, float] | None = None
    ) -> None:
        for one, values in ((self.bench, bench), (self.actuator, actuator)):
            one.do("fmi2Reset")
            one.messages.clear()
            one.initialize(values)

    def run(self, seconds: float, reference: float, current: float) -> bool:
        """Return True if all steps were taken; the one that failed has said why."""
        self.bench.set({"force_reference": reference})
        self.actuator.set({"current": current})
        for _ in range(round(seconds / STEP)):
            self.actuator.set({"length_change": self.bench.get("position")[0]})
            if not self.step(self.actuator):
                return False
            self.bench.set({"tension": self.actuator.get("tension")[0]})
            if not self.step(self.bench):
                return False
        return True

    def step(self, one: Instance) -> bool:
        status = one.call("fmi2DoStep", one.time, STEP, 1)
        one.time += STEP
        if status == OK:
            assert all(map(math.isfinite, one.everything()))
            return True
        assert status == ERROR
        assert one.messages
        assert "\n" not in one.messages[-1]
        return False


@pytest.fixture
def loop(fmu, runtime) -> Iterator[Loop]:
    with contextlib.ExitStack() as stack:
        yield Loop(
            *(stack.enter_context(instance(fmu(name, runtime))) for name in (BENCH, ACTUATOR))
        )


@pytest.mark.slow
def test_steps_of_reference_and_current(loop):
    """Settles at each reference to 1 %; beyond what 10 V give, K 10 V / R = 13 N, it stays at
    that.
    """
    loop.initialize()
    for reference, current in ((1.0, 0.0), (3.0, 0.9), (0.5, -0.9), (2.0, 0.0)):
        assert loop.run(1.0, reference, current)
        assert loop.bench.get("force_measured")[0] == pytest.approx(reference, rel=0.01)
    assert loop.run(1.0, 50.0, 0.0)
    assert loop.bench.get("coil_voltage") == [10.0]
    assert loop.bench.get("force_measured")[0] == pytest.approx(3.9 * 10.0 / 3.0, rel=0.01)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_and_the_loop_goes_on(loop, bad):
    loop.initialize()
    assert loop.run(0.3, 1.0, 0.0)
    for one, names in (
        (loop.bench, ("force_reference", "tension")),
        (loop.actuator, ("current", "length_change")),
    ):
        for name in names:
            assert one.call("fmi2SetReal", one.references([name]), 1, doubles(bad)) == ERROR
            assert f"'{name}'" in one.messages[-1]
    assert loop.run(0.7, 1.0, 0.0)
    assert loop.bench.get("force_measured")[0] == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("huge", [1e300, -1e300, 1e12])
def test_an_enormous_tension_is_survived(loop, huge):
    """The bench answers or says why not; reset, it works as before."""
    loop.initialize()
    assert loop.run(0.1, 1.0, 0.0)
    loop.bench.set({"tension": huge})
    loop.step(loop.bench)
    loop.initialize()
    assert loop.run(0.5, 1.0, 0.0)
    assert loop.bench.get("force_measured")[0] == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("name", [BENCH, ACTUATOR])
def test_every_extreme_of_a_parameter_runs_on_or_says_why_not(fmu, name):
    with instance(fmu(BENCH, "native")) as bench, instance(fmu(ACTUATOR, "native")) as actuator:
        loop = Loop(bench, actuator)
        for parameter in component(name).layout.parameters:
            for value in (parameter.min, parameter.max):
                if math.isfinite(value):
                    values = {parameter.name: value}
                    loop.initialize(*((values, None) if name == BENCH else (None, values)))
                    loop.run(0.005, 1.0, 0.5)
        loop.initialize()
        assert loop.run(0.5, 1.0, 0.0)
