"""Claims: the benches are wired as section 2.2 and 4.2 have them, and settle at their reference."""

import pytest

from orchestration.system import library

DMA_WIRES = {
    "bench.position": "actuator.length_change",
    "actuator.tension": "bench.tension",
}


def wires(name):
    return {str(c.source): str(c.target) for c in library.system(name).connections}


def test_the_protection_switches_off_the_controller_of_the_bench():
    assert wires("dma_bench") == DMA_WIRES
    assert wires("protected_bench") == DMA_WIRES | {
        "galvanostat.current": "actuator.current",
        "actuator.voltage": "galvanostat.voltage",
        "galvanostat.recovering": "bench.hold",
    }
    assert "hold" not in library.system("protected_bench").member("bench").parameters


@pytest.mark.slow
def test_the_bench_settles_at_its_reference_at_any_step(libcosim):
    inputs = {"bench.force_reference": 1.0, "actuator.current": 0.5}
    force = "bench.force_measured"
    coarse, fine = (libcosim("dma_bench", 0.5, inputs, [force], part)[force] for part in (1, 2))
    assert coarse[-1] == pytest.approx(1.0, rel=0.005)
    assert coarse == pytest.approx(
        fine[1::2], abs=0.03
    )  # of 1 N; the largest difference is in the first oscillation
