"""Claims: integers and booleans pass from member to member as what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from orchestration.master import run
from orchestration.system.model import Member, Port, System, connect
from tests.contract.models import Sampler
from tests.support.master.circle import TIME


@pytest.mark.parametrize("table", [(), ((0.0, 1.0), (1.0, 0.0))])
def test_integers_and_booleans(tmp_path, table):
    """In a chain each member is as if it ran alone, with what the one before delivers, or with what
    a table has in its place.
    """
    path = tmp_path / "sampler.fmu"
    path.write_bytes(build(Sampler, "native", [host_platform()]))
    members = (Member("a", path, {"enabled": 1.0}), Member("b", path))
    inputs = {"a": (Port("a", "u"),), "b": (Port("b", "u"),)}
    (wire,) = connect("a.high -> b.enabled")
    system = System("samplers", members, (replace(wire, table=table),), inputs)
    u = {"a": np.sin(3.0 * TIME), "b": np.cos(TIME)}
    for record in (None, ["b.count", "b.total", "a.high"]):
        result = run(system, TIME, u, method="jacobi", record=record)
        with Fmu(path, {"enabled": 1.0}) as fmu:
            fmu.start()
            first = simulate_instance(fmu, TIME, {"u": u["a"]})
        enabled = 1.0 - first["high"] if table else first["high"]
        with Fmu(path) as fmu:
            fmu.start()
            second = simulate_instance(fmu, TIME, {"u": u["b"], "enabled": enabled})
        assert {0.0, 1.0} == set(first["high"])
        for name, values in result.signals.items():
            expected = {"a": first, "b": second}[name[0]][name[2:]]
            assert values.tolist() == expected.tolist(), name
    assert list(result.signals) == ["b.count", "b.total", "a.high"]
    assert (result.units["b.count"], result.units["a.high"]) == ("1", "1")
