"""Bridge of a rig to OPC UA: its signals as variables, a method that stops it, and commands.

The bridge is a client of the rig as any other, whose server keeps limits and watchdog.
"""

from __future__ import annotations

import asyncio
import hmac
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from asyncua import Node, Server, ua
from asyncua.common.callback import CallbackType, ServerItemCallback
from asyncua.common.methods import uamethod
from asyncua.crypto.permission_rules import User, UserRole

from fmus.kit import UserError
from orchestration.plugins.driver import Driver
from orchestration.rig import Endpoint, ask
from orchestration.rig.watch import Feed, Listener

_NAMESPACE = "urn:ppy-rig"
_WRITE = ua.NodeId(ua.ObjectIds.WriteRequest_Encoding_DefaultBinary)
_STATE = ("state", "reason", "client", "latch", "alarm")
_REASON = 200  # characters of the reason of a stop


class _Access:
    """Rights of the sessions of OPC UA: everybody may read and stop, who knows a password writes.

    Parameters
    ----------
    password : str
        Empty if nobody may write.
    """

    def __init__(self, password: str) -> None:
        self._password = password.encode()

    def get_user(
        self, server: Any, username: str | None = None, password: str | None = None, **_: Any
    ) -> User | None:
        """Return who opens a session; None, which refuses it, if the password is wrong."""
        if username is None:
            return User(role=UserRole.Anonymous)
        is_known = hmac.compare_digest((password or "").encode(), self._password)
        return User(role=UserRole.User, name=username) if is_known and self._password else None

    def check_validity(self, user: User, request: ua.NodeId, body: Any) -> bool:
        """Return whether a user may send a request of a type."""
        return request != _WRITE or user.role == UserRole.User


class Bridge:
    """The bridge.

    Parameters
    ----------
    remote : Endpoint
    rig : Mapping
        The message ``status`` of the rig's server.
    driver : Driver
    password : str
        Of users who may drive; empty if nobody may.
    note : callable
        Called with a line if the rig cannot be stopped or driven.
    """

    def __init__(
        self,
        remote: Endpoint,
        rig: Mapping[str, Any],
        driver: Driver,
        password: str,
        note: Callable[[str], None],
    ) -> None:
        self._remote = remote
        self._rig = rig
        self._driver = driver
        self._access = _Access(password)
        self._note = note
        self._server = Server(user_manager=self._access)
        self._feed = Feed()
        self._nodes: dict[str, Node] = {}
        self._applied: Mapping[str, float | None] = {}

    async def run(self, address: str, ready: Callable[[], None]) -> None:
        """Serve until cancelled; UserError if the address cannot be bound to."""
        await self._server.init()
        self._server.set_endpoint(address)
        self._server.set_server_name("ppy rig")
        self._server.set_security_policy([ua.SecurityPolicyType.NoSecurity], self._access)
        await self._add_nodes()
        self._server.subscribe_server_callback(CallbackType.PreWrite, self._take)
        try:
            await self._server.start()
        except OSError as error:
            raise UserError(f"cannot listen at {address}: {error.strerror}") from error
        try:
            with Listener(self._remote, self._feed):
                ready()
                await asyncio.gather(self._show(), self._driver.run())
        finally:
            await self._driver.release()
            await self._server.stop()

    async def _add_nodes(self) -> None:
        """Add the object of the rig: its state, folders of inputs and outputs, and the method."""
        space = await self._server.register_namespace(_NAMESPACE)
        rig = await self._server.nodes.objects.add_object(ua.NodeId("rig", space), f"{space}:rig")
        for name in _STATE:
            place = ua.NodeId(name, space)
            self._nodes[name] = await rig.add_variable(place, f"{space}:{name}", "")
        for group in ("inputs", "outputs"):
            folder = await rig.add_folder(ua.NodeId(group, space), f"{space}:{group}")
            for name, unit in self._rig[group].items():
                place = ua.NodeId(f"{group}/{name}", space)
                node = await folder.add_variable(place, f"{space}:{name}", math.nan)
                text = ua.LocalizedText(unit)
                about = ua.EUInformation("", -1, text, text)  # -1: no code of a unit
                await node.add_property(ua.NodeId(), "0:EngineeringUnits", about)
                among = ua.Range(*_bounds(self._rig["limits"].get(name, {})))
                await node.add_property(ua.NodeId(), "0:EURange", among)
                if group == "inputs":
                    await node.set_writable()
                self._nodes[place.Identifier] = node
        reason = ua.Argument(Name="reason", DataType=ua.NodeId(ua.ObjectIds.String))
        await rig.add_method(ua.NodeId("stop", space), f"{space}:stop", self._stop, [reason], [])

    @uamethod
    async def _stop(self, parent: ua.NodeId, reason: str | None) -> ua.StatusCode:
        """Stop the rig, whoever asks."""
        text = f"OPC UA: {(reason or '')[:_REASON]}"
        try:
            await asyncio.to_thread(ask, self._remote, "stop", reason=text)
        except UserError as error:
            self._note(str(error))
            return ua.StatusCode(ua.StatusCodes.BadNoCommunication)
        return ua.StatusCode()

    async def _take(self, event: ServerItemCallback, service: Any) -> None:
        """Command what a user writes; an error refuses the whole request."""
        if not event.is_external:
            return
        values = {}
        for one in event.request_params.NodesToWrite:
            group, _, name = str(one.NodeId.Identifier).partition("/")
            if group != "inputs" or name not in self._rig["inputs"]:
                raise ua.uaerrors.BadNotWritable
            value = one.Value.Value.Value
            if not isinstance(value, float):
                raise ua.uaerrors.BadTypeMismatch
            low, high = _bounds(self._rig["limits"].get(name, {}))
            if not low <= value <= high:
                raise ua.uaerrors.BadOutOfRange
            values[name] = value
        try:
            await self._driver.write(values, self._applied)
        except UserError as error:
            self._note(str(error))
            raise ua.uaerrors.BadInvalidState from error

    async def _show(self) -> None:
        """Write what is new of the rig into the variables."""
        serial = -1
        contact: Mapping[str, Any] = {}
        while True:
            serial, _, items = self._feed.since(serial)
            newest = {item["kind"]: item for item in items}
            contact = newest.get("contact", contact)
            if "state" in newest or "contact" in newest:
                condition = self._feed.condition()[1] if contact["server"] else {}
                for name in _STATE:
                    await self._put(name, condition.get(name))
            if "sample" in newest:
                await self._show_sample(newest["sample"])
            elif "contact" in newest and not contact["samples"]:
                self._applied = {}
                for place in self._nodes.keys() - _STATE:
                    await self._put(place, None)
            await asyncio.sleep(self._driver.pause)

    async def _show_sample(self, sample: Mapping[str, Any]) -> None:
        """Write the values of a sample, each with the time at which it was measured."""
        self._applied = sample["inputs"]
        for name, value in self._applied.items():
            await self._put(f"inputs/{name}", value)
        for name, value in sample["outputs"].items():
            await self._put(f"outputs/{name}", value, sample["ages"].get(name))

    async def _put(self, place: str, value: Any, age: float | None = None) -> None:
        """Write a value and its age, s, into a variable; None is no value, which is bad there."""
        node = self._nodes.get(place)
        if node is None:  # a server with other signals has taken the place of the first one
            return
        code = ua.StatusCodes.BadNoData if value is None else ua.StatusCodes.Good
        measured = datetime.now(UTC) - timedelta(seconds=age or 0.0)
        await self._server.write_attribute_value(
            node.nodeid, ua.DataValue(value, ua.StatusCode(code), SourceTimestamp=measured)
        )


def _bounds(limit: Mapping[str, float | None]) -> tuple[float, float]:
    """Return the lowest and the highest value within a limit."""
    low, high = limit.get("min"), limit.get("max")
    return -math.inf if low is None else low, math.inf if high is None else high
