"""The five-hour life of an actuator (section 4.3, figs. 4-5 to 4-7), watched and protected as section 4.2 proposes.

Three native FMUs step in turn, each with what the one before has just delivered: the galvanostat, the ageing actuator,
the degradation estimator. The measured voltage reaches the galvanostat one communication step late, and so does the
voltage limit of the estimator.

The protection ends what it reacts to, and has a price that the thesis does not mention: without current the actuator
cools, its series resistance rises, and the next derating step comes sooner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus import component
from fmus.kit import Component
from fmus.kit.build import build_cached
from orchestration.experiment.waveforms import square_wave
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulate import grid
from orchestration.system.library import AGEING, AMPLITUDE, ESTIMATOR, FREQUENCY, ageing_actuator, capacitance

Array = NDArray[np.float64]

LIFE = 18000.0  # s, "approximately 5 hours"
# What is read of each FMU at every step; states of the actuator, which are no outputs, tell its series resistance.
_STATES = ["throughput", "temperature_rise"]
_DRIVE, _FILMS = ["current", "recovering"], ["voltage", *_STATES]
_WATCH = ["voltage_limit", "impedance", "impedance_change", "R1", "R2", "C", "estimate_valid"]


def run(
    duration: float = LIFE,
    step: float = 0.1,
    protected: bool = True,
    voltage_noise: float = 0.0,
    seed: int = 0,
    ageing: Mapping[str, float] = AGEING,
    estimator: Mapping[str, float] = ESTIMATOR,
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, Array]:
    """Let an actuator grow old.

    Parameters
    ----------
    duration, step : float
        Seconds; the step is that of communication, and the sample period of estimator and protection.
    protected : bool
        Whether the voltage limit reaches the galvanostat.
    voltage_noise : float
        Of the measured voltage, V rms, white.
    seed : int
    ageing, estimator : Mapping of str to float
        Parameters of the actuator and of the estimator.
    progress : callable
        Told the number of steps done, now and then.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By signal: ``time``, ``current_command``, ``current``, ``recovering``, ``voltage`` and ``series_resistance`` of
        the actuator as they are, ``measured_voltage``, and what the estimator says after its sample at that time.

    Raises
    ------
    UserError
        If an FMU cannot be built, refuses a parameter or fails.
    """
    parameters = {"C": capacitance()} | dict(ageing)
    time = grid(0.0, duration, step)[:-1]
    command = square_wave(time + 0.25 / FREQUENCY, AMPLITUDE, FREQUENCY)  # half a half period first: nearly periodic
    noise = voltage_noise * np.random.default_rng(seed).standard_normal(time.size)
    driven, moved, watched = (np.empty((time.size, len(names))) for names in (_DRIVE, _FILMS, _WATCH))
    with ExitStack() as opened:

        def started(cls: type[Component], values: Mapping[str, float]) -> Fmu:
            fmu = opened.enter_context(Fmu(build_cached(cls, "native"), values))
            fmu.start()
            return fmu

        drive = started(component("galvanostat"), {"protection_period": step, "control_period": step})
        films = started(ageing_actuator(), parameters)
        watch = started(component("degradation_estimator"), {"sample_period": step} | dict(estimator))
        inputs = ["current_command", "voltage", "voltage_limit"][: 3 if protected else 2]
        feed, energise, show = drive.writer(inputs), films.writer(["current"]), watch.writer(["current", "voltage"])
        of_drive, of_films, of_watch = drive.reader(_DRIVE), films.reader(_FILMS), watch.reader(_WATCH)
        of_watch(watched[0])
        fed, seen = np.zeros(len(inputs)), np.zeros(2)
        fed[2:] = watched[0, 0]
        for k, (now, wanted, error) in enumerate(zip(time.tolist(), command.tolist(), noise.tolist(), strict=True)):
            fed[0] = wanted
            feed(fed)
            drive.step(now, step)
            of_drive(driven[k])
            seen[0] = driven[k, 0]
            energise(seen)
            of_films(moved[k])  # before its step: the voltage follows the current at once
            films.step(now, step)
            seen[1] = moved[k, 0] + error
            show(seen)
            watch.step(now, step)
            of_watch(watched[k])
            fed[1], fed[2:] = seen[1], watched[k, 0]
            if k % 1000 == 0:
                progress(k)
    progress(time.size)
    signals = dict(zip([*_DRIVE, *_FILMS, *_WATCH], np.hstack([driven, moved, watched]).T, strict=True))
    aged: Any = ageing_actuator()(**parameters)
    for name in _STATES:
        setattr(aged, name, signals[name])  # a law on the record of its states
    truth = {"series_resistance": aged.series_resistance()}
    return {"time": time, "current_command": command, "measured_voltage": signals["voltage"] + noise} | signals | truth
