"""A system of two hand-written FMUs whose equations nobody knows, tau dx/dt = u - x, and its record
in closed form.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from orchestration.experiment.waveforms import multilevel
from orchestration.records import write_record
from orchestration.system import Member, Port, System, ssp
from orchestration.system.model import Connection
from tests.support.hosts import build_one_state_fmu

STEP, SAMPLES = 0.05, 2000


def lags(folder, gain=1.0, **taus):
    """A lag that feeds a lag, and the record of it in closed form, the second read by a sensor that
    is not straight.
    """
    fmu = build_one_state_fmu(folder)
    system = System(
        "lags",
        (Member("a", fmu), Member("b", fmu, {"tau": 3.0})),
        (Connection(Port("a", "x"), Port("b", "u"), factor=2.0, offset=0.5),),
        {"drive": (Port("a", "u"),)},
        step=STEP,
    )
    ssp.write(system, folder / "system.ssp")
    fine = 20  # parts of a sample
    time = STEP / fine * np.arange(SAMPLES * fine)
    drive = np.repeat(multilevel(time[::fine], [0.0, 0.4, 1.0], (0.5, 4.0), 5), fine)

    def lagged(signal, tau):
        keep = np.exp(-STEP / fine / tau)
        return lfilter([0.0, 1.0 - keep], [1.0, -keep], signal)

    first = lagged(drive, taus.get("a", 1.0))
    second = lagged(2.0 * first + 0.5, taus.get("b", 3.0))
    random = np.random.default_rng(1)
    record = {"drive": drive, "a.x": first, "b.x": second + gain * second * (second - 1.25)}
    record = {
        n: v[::fine] + 0.003 * (n != "drive") * random.standard_normal(SAMPLES)
        for n, v in record.items()
    }
    write_record(folder / "record.csv", time[::fine], record, dict.fromkeys(record, "1"))
    return system
