"""Socket of a run in real time, at which an operator moves its tunable parameters.

It is of this machine alone, and speaks as the operators' socket of a rig does; the rig's server has
no part in it. Everybody may look; moving needs the key that the run leaves for its user's programs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import zmq

from fmus.kit import UserError
from fmus.rig_proxy import protocol
from orchestration.rig.access import (
    EVERYBODY,
    Admission,
    Peer,
    access_control,
    guard_access,
    received,
    user_admission,
)
from orchestration.rig.endpoint import Endpoint, bound_queues, parse_address
from orchestration.rig.operator import ask
from orchestration.rig.server import EventLog

if TYPE_CHECKING:
    from orchestration.experiment.live import Tuner

_LOOK = 100  # ms between two looks at whether the run is over
_TIMEOUT = 0.4  # s that an answer may take, of a run that makes its steps meanwhile


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


_REQUESTS: dict[str, dict[str, Callable[[Any], bool]]] = {
    "parameters": {},
    "tune": {
        "name": lambda value: isinstance(value, str),
        "value": _is_number,
        "slew": lambda value: value is None or _is_number(value),
    },
}
_REPLIES = {
    "parameters": {"parameters": lambda value: isinstance(value, dict)},
    "refused": protocol.REPLIES["refused"],
}


@contextmanager
def tuning_socket(tuner: Tuner, port: int, log: Path | None) -> Iterator[str]:
    """Let operators move parameters while the context lasts.

    Parameters
    ----------
    tuner : Tuner
    port : int
        Of the loopback address; 0 takes a free one.
    log : Path or None
        File that every change is added to, as a server's log is (`ppy rig log`).

    Yields
    ------
    str
        The address.

    Raises
    ------
    UserError
        If the port is taken, or the log cannot be written.
    """
    with ExitStack() as stack:
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        stack.callback(context.destroy, linger=0)
        stack.enter_context(access_control([context], EVERYBODY))
        socket = context.socket(zmq.ROUTER)
        guard_access(socket)
        bound_queues(socket)
        try:
            socket.bind(f"tcp://127.0.0.1:{port or '*'}")
        except zmq.ZMQError as error:
            reason = f"{error}; --tuning-port chooses another one"
            raise UserError(f"cannot listen at 127.0.0.1:{port}: {reason}") from error
        address = socket.getsockopt_string(zmq.LAST_ENDPOINT)
        admission = stack.enter_context(user_admission(address))
        events = EventLog(log)
        stack.callback(events.close)
        ending = Event()
        arguments = (socket, admission, tuner, events.tell, ending)
        thread = Thread(target=_serve, args=arguments, daemon=True, name="tuning")
        thread.start()
        stack.callback(thread.join)
        stack.callback(ending.set)
        yield address


def _serve(
    socket: zmq.Socket[bytes],
    admission: Admission,
    tuner: Tuner,
    tell: Callable[[str], None],
    ending: Event,
) -> None:
    """Answer requests until the end."""
    while not ending.is_set():
        if socket.poll(_LOOK):
            peer, frames = received(socket, admission)
            answer = _answer(peer, frames[-1] if frames else b"", admission, tuner, tell)
            socket.send_multipart([peer.connection, answer], zmq.NOBLOCK)


def _answer(
    peer: Peer, frame: bytes, admission: Admission, tuner: Tuner, tell: Callable[[str], None]
) -> bytes:
    """Carry out a request, if the role of its sender's key permits it."""
    try:
        message = protocol.decode(frame, _REQUESTS)
        peer = admission.identify(peer, message)
        reason = admission.refusal(peer, message["type"])
        if reason:
            raise UserError(reason)
        if message["type"] == "tune":
            wanted = (message["name"], float(message["value"]), message["slew"])
            tell(tuner.move(*wanted, by=str(peer)))
    except (UserError, OverflowError) as error:
        return protocol.encode("refused", reason=str(error))
    return protocol.encode("parameters", parameters=tuner.state())


def request_tuning(address: str, kind: str, **fields: Any) -> dict[str, dict[str, Any]]:
    """Ask a run for its parameters, or to move one.

    Parameters
    ----------
    address : str
        Like ``tcp://127.0.0.1:5580``.
    kind : {"parameters", "tune"}
    **fields
        ``name``, ``value`` and ``slew`` of a ``tune``.

    Returns
    -------
    dict of str to dict
        By name: value, target, unit, min, max, doc.

    Raises
    ------
    UserError
        If no run answers, or it refuses.
    """
    parse_address(address, "--run")
    run = Endpoint(address, address, address)
    answer = ask(run, kind, _TIMEOUT, replies=_REPLIES, server="ppy run --tunable", **fields)
    parameters: dict[str, dict[str, Any]] = answer["parameters"]
    return parameters
