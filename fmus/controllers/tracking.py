"""Back-calculation (anti-windup): the state of a controller whose command was not carried out."""

from __future__ import annotations

from typing import Any

from ..kit import maximum


def tracking_share(period: Any, tracking_time: Any) -> Any:
    """Return the share of the windup that is removed at a sample, h / T_t, or 1 where T_t < h.

    Parameters
    ----------
    period : float
        Sample period h in s.
    tracking_time : float
        Tracking time T_t in s.

    Returns
    -------
    float
        From 0 to 1.
    """
    return period / maximum(tracking_time, period)


def back_calculated(unlimited: Any, applied: Any, share: Any) -> Any:
    """Return the command from which the law continues: the applied one plus the rest of the excess.

    Parameters
    ----------
    unlimited : float
        Command of the law, before its limits.
    applied : float
        Command that was carried out, in the same unit; where both are equal, so is the result, to
        the last bit.
    share : float
        Share of the excess (the windup) that is removed, see :func:`tracking_share`.

    Returns
    -------
    float

    Notes
    -----
    Astrom, Hagglund: Advanced PID Control, 2006, section 3.5, for the incremental form.
    """
    return applied + (1.0 - share) * (unlimited - applied)
