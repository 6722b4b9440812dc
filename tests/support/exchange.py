"""Model exchange in another tool, fmpy where none is named, beside co-simulation in our master."""

from __future__ import annotations

from functools import partial

import numpy as np
from fmpy import read_model_description, simulate_fmu

from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance

HELD = 10  # communication steps
BY_FMPY = partial(simulate_fmu, record_events=False)


def both_ways(
    exchanged_fmu,
    stepped_fmu,
    stop,
    step,
    stimuli,
    refined=1,
    start_values=None,
    simulate=BY_FMPY,
    **options,
):
    """Results of model exchange in a tool and of co-simulation in our master, where no input
    jumps: of one FMU that offers both, or of two builds.
    """
    time = np.arange(0.0, stop, step)
    jumps = np.arange(0, time.size, HELD)
    held = {
        name: mean + size * np.sin(speed * time[jumps])
        for name, (mean, size, speed) in stimuli.items()
    }
    table = np.zeros(2 * jumps.size, [("time", float), *((name, float) for name in stimuli)])
    table["time"] = np.append(np.repeat(time[jumps], 2)[1:], stop + 1.0)
    for name, values in held.items():
        table[name] = np.repeat(values, 2)
    outputs = [
        v.name
        for v in read_model_description(str(exchanged_fmu)).modelVariables
        if v.causality == "output" and v.type in ("Real", "Float64")
    ]
    exchanged = simulate(
        str(exchanged_fmu),
        stop_time=time[-1],
        output_interval=step / refined,
        output=outputs,
        input=table,
        start_values=start_values or {},
        **{"fmi_type": "ModelExchange"} | options,
    )[::refined]
    with Fmu(stepped_fmu, start_values or {}) as one:
        one.start(0.0)
        stepped = simulate_instance(
            one, time, {k: v[np.arange(time.size) // HELD] for k, v in held.items()}, outputs
        )
    keep = np.setdiff1d(np.arange(1, time.size), jumps)
    np.testing.assert_allclose(exchanged["time"], time, rtol=0, atol=1e-9)
    return {name: (exchanged[name][keep], stepped[name][keep]) for name in outputs}


def distance(found, expected):
    """Largest difference relative to the largest value; true is 1."""
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    return np.abs(found - expected).max() / (np.abs(expected).max() or 1.0)
