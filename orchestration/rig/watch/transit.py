"""Bound of the transit time of a message of a rig's server, without synchronised clocks."""

from __future__ import annotations

# s by which two monotonic clocks part in a second, at most: each is slewed by 500 ppm at most
# (adjtimex(2)), which is more than its crystal is off
_DRIFT = 1e-3


class TransitBound:
    """Upper bound of the transit time of messages that the server stamps with its own clock.

    An answer is stamped after its request was sent. So from ``sent - clock`` of a round trip, the
    earliest moment of any other stamp is known (Cristian, Probabilistic clock synchronization,
    1989). The greatest of all round trips is the tightest; it is loosened by the drift of clocks.
    """

    def __init__(self) -> None:
        self._offset: float | None = None  # of our clock from the server's, s; it is no less
        self._since = 0.0

    def take_round_trip(self, sent: float, clock: float, received: float) -> None:
        """Take a request and its answer.

        Parameters
        ----------
        sent, received : float
            On our clock, in s.
        clock : float
            Stamp of the answer, on the server's clock, in s.
        """
        least, most = sent - clock, received - clock
        offset = self._offset_at(sent)
        is_consistent = offset is not None and least <= offset <= most
        self._offset = offset if is_consistent else least
        self._since = sent

    def transit_time(self, clock: float, received: float) -> float | None:
        """Return the longest possible transit time of a message.

        Parameters
        ----------
        clock : float
            Stamp of the message, on the server's clock, in s.
        received : float
            Time of its arrival on our clock, in s.

        Returns
        -------
        float or None
            In s; None if it is not known, as of a server whose clock is not the one of the last
            round trip.
        """
        offset = self._offset_at(received)
        if offset is None or received < clock + offset:
            return None
        return received - clock - offset

    def _offset_at(self, now: float) -> float | None:
        if self._offset is None:
            return None
        return self._offset - _DRIFT * abs(now - self._since)
