"""Claims: an actuator can take the place of the proxy."""

from dataclasses import replace

import numpy as np

from orchestration.master import run as run_master
from orchestration.system import Port, library
from orchestration.system.checking import interface


def test_the_bench_is_closed_over_the_proxy():
    wires = {str(c.source): str(c.target) for c in library.system("hil_bench").connections}
    assert wires == {
        "bench.position": "proxy.length_change",
        "proxy.tension": "bench.tension",
    }


def test_an_actuator_takes_the_place_of_the_proxy_and_the_bench_does_not_notice():
    usual, time = library.system("dma_bench"), 1e-4 * np.arange(1001)
    held = {"force_reference": np.full(time.size, 2.0), "current": np.full(time.size, 0.5)}
    actuator, proxied = usual.member("actuator").fmu, library.system("hil_bench", "python")
    assert {**proxied.inputs} == {**usual.inputs, "current": (Port("proxy", "current"),)}
    members = (usual.member("bench"), replace(proxied.member("proxy"), fmu=actuator))
    other = run_master(replace(proxied, members=members), time, held).signals
    for name, values in run_master(usual, time, held).signals.items():
        assert np.array_equal(values, other[name.replace("actuator.", "proxy.")])


def test_the_proxy_has_every_signal_of_the_actuator():
    """Not the other way round: it tells of its link, too."""
    models = [
        interface(m)
        for m in (
            library.system("dma_bench").member("actuator"),
            library.system("hil_bench", "python").member("proxy"),
        )
    ]
    for group in ("inputs", "outputs"):
        actuator, proxy = (getattr(model, group) for model in models)
        # no rig tells what is left to a limit
        actuator = {name: s for name, s in actuator.items() if not name.endswith("_margin")}
        assert {name: (s.type, s.unit) for name, s in actuator.items()} == {
            name: (proxy[name].type, proxy[name].unit) for name in actuator
        }
