"""Driving a rig for clients of a bridge, who know a password and write now and then."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.kit import UserError
from fmus.rig_proxy import Link, LinkError, read_table
from orchestration.rig import LOOPBACK, Endpoint

_OPENING = 2.0  # s for the answer to the first command
_SLOWEST = 0.02  # s between two commands where the rig is faster
_SHARE = 0.2  # of the rig's watchdog, where that is shorter
_SHORTEST = 8  # characters of a password


class Driver:
    """A session with a rig's server, from a written value until none was written for a while.

    Parameters
    ----------
    remote : Endpoint
    rig : Mapping
        The message ``status`` of the rig's server.
    credentials : Path or None
        Key file of a client that may command.
    lease : float
        Time in s after the newest write in which the rig is driven.
    note : callable
        Called with a line about each end.

    Attributes
    ----------
    pause : float
        Time between two commands in s.
    """

    def __init__(
        self,
        remote: Endpoint,
        rig: Mapping[str, Any],
        credentials: Path | None,
        lease: float,
        note: Callable[[str], None],
    ) -> None:
        self._remote = remote
        self._rig = rig
        self._credentials = credentials
        self._lease = lease
        self._note = note
        self.pause = max(rig["period"], _SLOWEST)
        if rig["watchdog"]:
            self.pause = min(self.pause, _SHARE * rig["watchdog"])
        self._link: Link | None = None
        self._lock = asyncio.Lock()  # a link takes one call at a time
        self._values: dict[str, float] = {}
        self._written = -math.inf

    async def write(self, values: Mapping[str, float], applied: Mapping[str, float | None]) -> None:
        """Command some inputs from now on; the first time, the others stay as they are.

        Parameters
        ----------
        values : Mapping of str to float
            SI.
        applied : Mapping of str to float or None
            Values that the rig has.

        Raises
        ------
        UserError
            If the rig's server does not answer or refuses, or an input has no known value.
        """
        async with self._lock:
            if self._link is None:
                begin = {name: applied.get(name) for name in self._rig["inputs"]} | dict(values)
                self._values = {n: value for n, value in begin.items() if value is not None}
                if unknown := begin.keys() - self._values.keys():
                    raise UserError(f"the rig does not say what it has of {', '.join(unknown)}")
                self._link = await asyncio.to_thread(self._open)
            self._values.update(values)
            self._written = monotonic()
        await self._send()

    async def run(self) -> None:
        """Send the commands as long as values are written; until cancelled."""
        while True:
            await asyncio.sleep(self.pause)
            if self._link is None:
                continue
            if monotonic() - self._written > self._lease:
                self._note(f"nothing was written for {self._lease:g} s: the rig is driven no more")
                await self.release()
                continue
            try:
                await self._send()
            except LinkError as error:
                self._note(str(error))

    async def _send(self) -> None:
        """Send the commands; LinkError, after which there is no session, if they are refused."""
        try:
            async with self._lock:
                if self._link is not None:
                    await asyncio.to_thread(self._exchange, self._link)
        except LinkError:
            await self.release()
            raise

    async def release(self) -> None:
        """End the session, if there is one: the rig goes to rest."""
        async with self._lock:
            link, self._link = self._link, None
            if link is not None:
                await asyncio.to_thread(link.disconnect)
                link.close()

    def _open(self) -> Link:
        link = Link(
            self._remote.requests,
            self._rig["inputs"],
            self._rig["outputs"],
            self._credentials,
            "ppy rig opcua",
        )
        try:
            link.connect(0.0, _OPENING)
        except BaseException:
            link.close()
            raise
        return link

    def _exchange(self, link: Link) -> None:
        values = [self._values[name] for name in self._rig["inputs"]]
        link.exchange(values, monotonic(), self.pause, self.pause)


def read_password(path: Path | None, host: str, warn: Callable[[str], None]) -> str:
    """Return the password with which the rig may be driven; empty without a file.

    Raises
    ------
    UserError
        If the file has none, or the host is not this machine, beyond which it would be legible.
    """
    if path is None:
        return ""
    if host != LOOPBACK:
        raise UserError(
            f"--bind {host}: has to be {LOOPBACK} with --password, which is sent legibly"
        )
    password = read_table(path, warn).get("password")
    if not isinstance(password, str) or len(password) < _SHORTEST:
        raise UserError(f"{path}: password: a text of at least {_SHORTEST} characters is wanted")
    return password
