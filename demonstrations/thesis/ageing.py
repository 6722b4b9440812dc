"""Five-hour life of an actuator (section 4.3, figs. 4-5 to 4-7), protected as in section 4.2.

The system is ``degradation_watch``: galvanostat, ageing actuator, degradation estimator. The master
uses Jacobi's method: estimator and protection are sampled controllers, which read values of the
sample instant and act from the next one on. With Gauss-Seidel the estimator would read the voltage
at the end of a period with the current at its beginning, which is another circuit.

The protection has a price that the thesis does not mention: without current the actuator cools, its
series resistance rises, and the next derating step comes sooner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fmus.degradation_estimator.systems import AMPLITUDE, ESTIMATOR, FREQUENCY
from fmus.kit.arrays import Array
from orchestration import master
from orchestration.experiment.waveforms import square_wave
from orchestration.fmu.simulation import grid
from orchestration.system import library

LIFE = 18000.0  # s, "approximately 5 hours"
_NO_LIMIT = 15.0  # V, the compliance of the galvanostat: no voltage is beyond it
# states of the actuator that are no outputs, for its series resistance
_STATES = ("actuator.throughput", "actuator.temperature_rise")
_READ = (
    "galvanostat.current",
    "galvanostat.recovering",
    "actuator.voltage",
    *_STATES,
    "estimator.voltage_limit",
    "estimator.impedance",
    "estimator.impedance_change",
    "estimator.R1",
    "estimator.R2",
    "estimator.C",
    "estimator.estimate_valid",
)


def run(
    duration: float = LIFE,
    protected: bool = True,
    voltage_noise: float = 0.0,
    seed: int = 0,
    estimator: Mapping[str, float] = ESTIMATOR,
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, Array]:
    """Simulate the life of an actuator.

    Parameters
    ----------
    duration : float
        Seconds.
    protected : bool
        Whether the voltage limit reaches the galvanostat.
    voltage_noise : float
        RMS of white noise of the measured voltage, V.
    seed : int
    estimator : Mapping of str to float
        Parameters of the estimator.
    progress : callable
        Called now and then with the number of computed samples.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        At the sample instants: ``time``, ``current_command``, ``current``, ``recovering``, true
        ``voltage`` and ``series_resistance`` of the actuator, ``measured_voltage``, and outputs of
        the estimator before its sample.

    Raises
    ------
    UserError
        If an FMU cannot be built, refuses a parameter or fails.
    """
    system = library.system("degradation_watch").given(
        {f"estimator.{name}": v for name, v in estimator.items()}
    )
    if not protected:
        system = system.disconnected("galvanostat.voltage_limit", _NO_LIMIT)
    time = grid(0.0, duration, system.step)[:-1]
    # begins in the middle of a half period, which is nearly the periodic state
    command = square_wave(time + 0.25 / FREQUENCY, AMPLITUDE, FREQUENCY)
    error = voltage_noise * np.random.default_rng(seed).standard_normal(time.size)
    inputs = {"current_command": command}
    if voltage_noise:
        system = library.with_voltmeter(system, "actuator.voltage")
        inputs = inputs | {"voltage_error": error}
    life = master.run(system, time, inputs, method="jacobi", record=_READ, progress=progress)
    if not life.complete:
        raise KeyboardInterrupt
    signals = {name.partition(".")[2]: values for name, values in life.signals.items()}
    actuator = system.member("actuator")
    cls: Any = actuator.cls
    aged = cls(**actuator.parameters)
    for name in _STATES:  # the law is evaluated on records of the states
        setattr(aged, name.partition(".")[2], life.signals[name])
    made = {
        "series_resistance": aged.series_resistance(),
        "measured_voltage": signals["voltage"] + error,
    }
    return {"time": time, "current_command": command} | signals | made
