"""Socket that publishes telemetry, with a limit of subscriptions."""

from __future__ import annotations

from collections.abc import Callable

import zmq

# ZeroMQ keeps every topic that any peer asks for, in memory and in the time of each message.
# Telemetry has none: a viewer subscribes to the empty one, which counts once for all viewers.
_MOST_TOPICS = 100


class TelemetrySocket:
    """Socket of type XPUB, which is opened anew when its subscribers ask for too many topics.

    Parameters
    ----------
    make : callable
        Returns a new XPUB.
    address : str
        Address to bind to.

    Raises
    ------
    zmq.ZMQError
        If it cannot be bound to.
    """

    def __init__(self, make: Callable[[], zmq.Socket[bytes]], address: str) -> None:
        self._make = make
        self._address = address
        self._socket: zmq.Socket[bytes] | None = self._bind_new()
        self._topics = 0

    def _bind_new(self) -> zmq.Socket[bytes]:
        socket = self._make()
        try:
            socket.bind(self._address)
        except zmq.ZMQError:
            socket.close(linger=0)
            raise
        return socket

    def publish(self, message: bytes) -> bool:
        """Publish a message.

        Parameters
        ----------
        message : bytes

        Returns
        -------
        bool
            False if there were too many topics: all subscribers have to connect anew, as ZeroMQ's
            do by themselves.
        """
        if self._socket is None:
            self._open_again()
        if self._socket is not None:
            self._socket.send(message, zmq.NOBLOCK)
            if self._count_topics(self._socket):
                self.close()
                return False
        return True

    def _count_topics(self, socket: zmq.Socket[bytes]) -> bool:
        """Count new subscriptions; return True if there are more than are allowed."""
        while self._topics <= _MOST_TOPICS:
            try:
                socket.recv(zmq.NOBLOCK)
            except zmq.Again:
                return False
            self._topics += 1
        return True

    def _open_again(self) -> None:
        """Bind a new socket, as soon as the address of the one before is free."""
        try:
            self._socket = self._bind_new()
        except zmq.ZMQError:
            return
        self._topics = 0

    def close(self) -> None:
        """Close the socket until something is published: all subscribers have to connect anew."""
        if self._socket is not None:
            self._socket.close(linger=0)
            self._socket = None
