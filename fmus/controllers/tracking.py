"""Back-calculation: what a controller remembers of a command that was not carried out."""

from __future__ import annotations

from typing import Any

from ..kit import maximum


def tracking_share(period: Any, tracking_time: Any) -> Any:
    """Share of the excess that is forgotten at a sample, h / T_t, and all of it where T_t < h.

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


def tracked(unlimited: Any, applied: Any, share: Any) -> Any:
    """Command to go on from after a sample: the applied one, and what is kept of the excess.

    Parameters
    ----------
    unlimited : float
        Command of the law, before its limits.
    applied : float
        Command that was carried out, in the same unit; where both are equal, so is the result, to
        the bit.
    share : float
        Of :func:`tracking_share`.

    Returns
    -------
    float

    Notes
    -----
    Astrom, Hagglund: Advanced PID Control, 2006, section 3.5, for the incremental form.
    """
    return applied + (1.0 - share) * (unlimited - applied)
