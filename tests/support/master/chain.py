"""Two masses coupled by a spring without state, and their exact motion."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from orchestration.master import run
from orchestration.system.model import Member, System, connect
from tests.support.master.models import Mass, Spring


def two_masses(folder, runtime):
    """Two masses, each on a spring of its own, with a third spring between them that has no
    state.
    """
    paths = {}
    for cls in (Mass, Spring):
        paths[cls] = folder / f"{cls.name}.fmu"
        paths[cls].write_bytes(build(cls, runtime, [host_platform()]))
    members = (
        Member("a", paths[Mass], {"position_start": 1.0, "left": 0.0}),
        Member("s", paths[Spring]),
        Member("b", paths[Mass], {"m": 0.5, "right": 0.0}),
    )
    wires = connect(
        "a.position -> s.one", "b.position -> s.other", "s.force -> a.right", "s.force -> b.left"
    )
    return System("chain", members, wires)


def exact_chain(stop):
    def rates(t, z):
        force = 2.0 * (z[2] - z[0])
        return [z[1], force - z[0], z[3], (-force - z[2]) / 0.5]

    return solve_ivp(rates, (0.0, stop), [1.0, 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-13).y[[0, 2], -1]


def chain_error(chain, steps, **options):
    result = run(chain, np.linspace(0.0, 4.0, steps + 1), **options)
    return np.abs(
        [result.signals["a.position"][-1], result.signals["b.position"][-1]] - exact_chain(4.0)
    ).max()
