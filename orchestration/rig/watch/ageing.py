"""The degradation estimator as an observer beside a running rig, with an alarm at a rise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from fmus.kit import UserError
from orchestration.fmu import Fmu, find_model
from orchestration.rig.watch.feed import Feed

_ESTIMATOR = "degradation_estimator"
_PERIOD = 0.1  # s; three samples of telemetry at its fastest
_ROUNDING = 0.1  # of the period, by which a sample may be early
_READ = ("estimate_valid", "impedance_change", "voltage_limit")

Observer = Callable[[Mapping[str, Any]], None]


@contextmanager
def ageing_observed(
    feed: Feed, rise: float, warn: Callable[[str], None] = lambda text: None
) -> Iterator[Observer]:
    """Yield an observer of telemetry that adds an alarm once the impedance has risen by a share.

    It estimates from the current that is read back, else commanded, and the voltage; while either
    is unknown, as without contact, it stands still. It commands nothing.

    Parameters
    ----------
    feed : Feed
        Gets the alarm, for all pages.
    rise : float
        Share of the first valid impedance.
    warn : callable
        Gets the text of the alarm, too.

    Raises
    ------
    UserError
        If the estimator cannot be built.
    """
    with Fmu(find_model(_ESTIMATOR).path, {"sample_period": _PERIOD}) as fmu:
        fmu.start()
        write = fmu.writer(("current", "voltage"))
        read = fmu.reader(_READ)
        row = np.zeros(len(_READ))
        steps = 0
        due = -np.inf
        is_told = False

        def observe(message: Mapping[str, Any]) -> None:
            nonlocal steps, due, is_told
            current = message["read_back"].get("current", message["inputs"].get("current"))
            voltage = message["outputs"].get("voltage")
            clock = message["clock"]
            # the clock of a server that was started again is an earlier one
            if current is None or voltage is None or due - _PERIOD < clock < due:
                return
            due = clock + (1.0 - _ROUNDING) * _PERIOD
            try:
                write(np.array([current, voltage]))
                fmu.step(steps * _PERIOD, _PERIOD)
                read(row)
            except UserError as error:
                feed.event("alarm", f"the ageing is not observed: {error}")
                return
            steps += 1
            valid, change, limit = row.tolist()
            if valid and change >= rise and not is_told:
                is_told = True
                text = (
                    f"ALARM: the impedance has risen by {100.0 * change:.1f} %; the derated voltage"
                    f" limit is {limit:.4g} V"
                )
                feed.event("alarm", text)
                warn(text)

        yield observe
