"""Both builds of the proxies in three masters, at the server in lockstep: the values of the
emulated rig.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

from demonstrations.backend import Emulator
from fmus import component
from fmus.kit import stack
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from tests.support import hosts
from tests.support.pace import slow_but
from tests.support.rig.process import Server

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the hosts of the tests run on Linux"
)

MASTERS = [("run_fmpy", 2), ("run_libcosim", 2), ("run_ecos", 2), ("run_ecos", 3)]
TIMES = np.linspace(0.0, 4.0, 81)
CURRENT = np.where(np.sin(4.0 * TIMES) > 0.0, 1.0, -0.6)
CASES = {
    "rig_proxy": ("force-driven", {"current": CURRENT, "force": 1.0 + 0.5 * np.sin(TIMES)}),
    "rig_proxy_length_driven": (
        "length-driven",
        {"current": CURRENT, "length_change": 4e-4 + 2e-4 * np.sin(TIMES)},
    ),
    "rig_proxy_bench": (
        "bench",
        {"current": CURRENT, "force_reference": np.where(TIMES < 2.0, 1.0, 2.0)},
    ),
}


def stepped(
    signals: str, inputs: dict[str, np.ndarray], outputs: list[str]
) -> dict[str, np.ndarray]:
    """Step the emulated rig itself, with inputs held."""
    rig = Emulator(signals=signals, hidden="double_layer", seed="5", noise="off")
    table = {name: np.empty(len(TIMES)) for name in outputs}
    for k in range(len(TIMES)):
        for name in outputs:
            table[name][k] = rig.read()[name]
        if k + 1 < len(TIMES):
            rig.write({name: float(column[k]) for name, column in inputs.items()})
            rig.advance(TIMES[k + 1] - TIMES[k])
    rig.close()
    return table


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "runtime", "master", "fmi"),
    slow_but(
        [(name, runtime, *way) for name in CASES for runtime in RUNTIMES for way in MASTERS],
        ("rig_proxy", "native", "run_libcosim", 2),
        ("rig_proxy", "python", "run_ecos", 2),
        ("rig_proxy", "native", "run_fmpy", 2),
        ("rig_proxy", "native", "run_ecos", 3),
    ),
)
def test_outputs_are_those_of_the_emulated_rig_stepped_here(tmp_path, name, runtime, master, fmi):
    signals, inputs = CASES[name]
    options = {"signals": signals, "hidden": "double_layer", "seed": 5, "noise": "off"}
    with Server(tmp_path, "emulator", "--lockstep", options=options) as server:
        server.wait_ready()
        archive = tmp_path / f"{name}.fmu"
        here = stack(component(name), name=name, defaults={"endpoint": server.endpoint})
        archive.write_bytes(build(here, runtime, [host_platform()], fmi=fmi))
        outputs = [
            o.name
            for o in component(name).layout.outputs
            if o.name + "_age" in component(name).layout.names
        ]
        found = getattr(hosts, master)(archive, TIMES, inputs, outputs)
    expected = stepped(signals, inputs, outputs)
    for output in outputs:
        size = np.max(np.abs(expected[output]))
        assert size > 0.0
        # libcosim shows nothing at the first point
        assert found[output][1:] == pytest.approx(expected[output][1:], rel=1e-9, abs=1e-9 * size)
