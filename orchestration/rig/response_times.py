"""Response times of a rig to this machine at a rate, measured before a run begins."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter, sleep
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.rig_proxy import LOCKSTEP, Link

_LASTS = 1.0  # s, of the measurement at rates of 10 Hz and more
_SLOWEST = 0.1  # s; at a longer step the machine is asked as often as this
_OPENING = 2.0  # s for the first answer
# one point in a thousand may be late, for a loop tolerates a delay of one step (by its sampling)
_SHARE = 0.999
RATES = (1000, 500, 300, 200, 100, 50, 30, 20, 10)  # Hz; the answer is one of them


@dataclass(frozen=True)
class ResponseTimes:
    """The response times of a rig to requests at regular intervals.

    Attributes
    ----------
    step : float
        Time between two requests in s.
    times : ndarray, shape (n,)
        Times from when each request was due to its answer, in s, ascending.
    watchdog : float
        Watchdog time of the rig in s.
    """

    step: float
    times: Array
    watchdog: float

    def quantile(self, share: float) -> float:
        """Return the time that a share of the answers did not exceed, s."""
        return float(np.quantile(self.times, share, method="inverted_cdf"))

    def holds(self, step: float) -> bool:
        """Return whether answers arrive within a step, but for one in a thousand."""
        return self.quantile(_SHARE) <= step

    @property
    def longest_pause(self) -> float:
        """Longest pause of a run, s: half the watchdog, so that the run ends it before the rig."""
        return 0.5 * self.watchdog

    def __str__(self) -> str:
        shares = {"p50": 0.5, "p99": 0.99, "p99.9": _SHARE, "max": 1.0}
        return ", ".join(f"{name} {1e3 * self.quantile(q):.3g} ms" for name, q in shares.items())


def measure_response_times(link: Link, step: float) -> ResponseTimes | None:
    """Ask a rig for its status at even times for a second; nothing moves.

    Parameters
    ----------
    link : Link
        Link that has no session.
    step : float
        Time between two questions, in s.

    Returns
    -------
    ResponseTimes or None
        None if the rig waits for its client, for which every time is the right one.

    Raises
    ------
    UserError
        If the rig does not answer.
    """
    first = _ask_status(link, _OPENING)
    if first["mode"] == LOCKSTEP:
        return None
    interval = min(step, _SLOWEST)
    times = np.empty(max(2, round(_LASTS / interval)))
    begin = perf_counter() + interval
    for k in range(times.size):
        due = begin + k * interval
        sleep(max(0.0, due - perf_counter()))
        _ask_status(link, _OPENING)
        times[k] = perf_counter() - due
    return ResponseTimes(step, np.sort(times), first["watchdog"])


def check_response_times(measured: ResponseTimes, endpoint: str) -> None:
    """Refuse a run at a rate that this machine cannot keep.

    Parameters
    ----------
    measured : ResponseTimes
    endpoint : str
        Address of the rig's server.

    Raises
    ------
    UserError
        If more than one answer in a thousand is later than a step: what the machine holds, and what
        to do.
    """
    if measured.holds(measured.step):
        return
    held = next((f"it holds {rate} Hz" for rate in RATES if measured.holds(1.0 / rate)), "")
    raise UserError(
        f"this machine does not hold {1.0 / measured.step:.4g} Hz with the rig at {endpoint}:"
        f" answers come {measured} after they are due; {held or 'it holds no rate'}. Take a longer"
        " step if the loop is stable with it (ppy rig serve --lockstep shows it for an emulated"
        " rig), --priority, --device-priority of ppy rig serve, or give the machine less to do"
    )


def _ask_status(link: Link, timeout: float) -> dict[str, Any]:
    """Return the status of a rig; UserError without an answer in time."""
    status = link.status(timeout)
    if status is None:
        raise UserError(
            f"no answer within {timeout:g} s from {link.endpoint}; is `ppy rig serve` running, or"
            " do the keys not match?"
        )
    return dict(status)
