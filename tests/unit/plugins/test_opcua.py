"""Bridge to OPC UA between a client of asyncua and a small rig that shares no code with ours."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from datetime import UTC, datetime
from typing import Any

import pytest
from asyncua import Client, ua

from fmus.kit.errors import UserError
from orchestration.plugins.driver import Driver
from orchestration.plugins.opcua import Bridge
from orchestration.rig import ask, read_endpoint
from tests.support.rig.small_rig import SmallRig, free_port

pytestmark = pytest.mark.slow  # it takes seconds to load the address space of OPC UA

PASSWORD = "correct horse"
LEASE = 0.4  # s
PATIENCE = 5.0  # s, for what takes milliseconds on an idle machine


@pytest.fixture
def rig() -> Iterator[SmallRig]:
    with SmallRig() as one:
        yield one


@contextlib.asynccontextmanager
async def bridge(rig: SmallRig, password: str = PASSWORD) -> AsyncIterator[str]:
    """Run a bridge, and yield its address."""
    remote = read_endpoint(rig.endpoint)
    about = ask(remote, "status")
    driver = Driver(remote, about, None, LEASE, print)
    address = f"opc.tcp://127.0.0.1:{free_port()}/rig"
    ready = asyncio.Event()
    served = Bridge(remote, about, driver, password, print)
    task = asyncio.create_task(served.run(address, ready.set))
    await asyncio.wait({task, asyncio.create_task(ready.wait())}, return_when="FIRST_COMPLETED")
    try:
        yield address
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def client(address: str, password: str = "") -> Client:
    one = Client(address)
    if password:
        one.set_user("operator")
        one.set_password(password)
    return one


def node(one: Client, place: str) -> Any:
    return one.get_node(f"ns=2;s={place}")


async def until(claim: Callable[[], Awaitable[bool]]) -> None:
    end = time.monotonic() + PATIENCE
    while not await claim():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


async def value(one: Client, place: str) -> ua.DataValue:
    return await node(one, place).read_data_value(raise_on_bad_status=False)


async def has(one: Client, place: str, expected: object) -> bool:
    return (await value(one, place)).Value.Value == expected


def test_signals_are_variables_with_units_limits_and_the_time_of_their_measurement(
    rig: SmallRig,
) -> None:
    async def check() -> None:
        async with bridge(rig) as address, client(address) as one:
            await until(lambda: has(one, "outputs/voltage", 0.0))
            shown = await value(one, "outputs/voltage")
            age = datetime.now(UTC) - shown.SourceTimestamp.replace(tzinfo=UTC)
            assert 0.0 <= age.total_seconds() < 1.0
            assert await has(one, "state", "idle")
            voltage = node(one, "outputs/voltage")
            about = {
                p.Name: v
                for p, v in [
                    (await p.read_browse_name(), await p.read_value())
                    for p in await voltage.get_properties()
                ]
            }
            assert about["EngineeringUnits"].DisplayName.Text == "V"
            assert (about["EURange"].Low, about["EURange"].High) == (-1.0, 1.0)

    asyncio.run(check())


def test_a_value_that_is_none_is_bad_and_so_is_all_without_contact(rig: SmallRig) -> None:
    async def check() -> None:
        async def is_bad(place: str) -> bool:
            return (await value(one, place)).StatusCode.is_bad()

        async with bridge(rig) as address, client(address) as one:
            await until(lambda: has(one, "outputs/voltage", 0.0))
            rig.plant = lambda inputs, now: {"voltage": None, "displacement": 1.0}
            await until(lambda: has(one, "outputs/displacement", 1.0))
            assert await is_bad("outputs/voltage")
            rig.publishes = False
            await until(lambda: is_bad("outputs/displacement"))
            rig.answers = False
            await until(lambda: is_bad("state"))

    asyncio.run(check())


def test_whoever_is_there_may_stop_the_rig(rig: SmallRig) -> None:
    async def check() -> None:
        async with bridge(rig, "") as address, client(address) as one:
            await node(one, "rig").call_method("2:stop", "smoke")
            await until(lambda: has(one, "state", "safe"))
            assert rig.reason == "OPC UA: smoke"
            rig.answers = False
            with pytest.raises(ua.uaerrors.BadNoCommunication):
                await node(one, "rig").call_method("2:stop", "smoke")

    asyncio.run(check())


def test_a_written_value_drives_the_rig_until_none_is_written_for_a_while(rig: SmallRig) -> None:
    async def check() -> None:
        async with bridge(rig) as address, client(address, PASSWORD) as one:
            await until(lambda: has(one, "inputs/current", 0.0))
            await node(one, "inputs/current").write_value(0.5)
            began = time.monotonic()
            await until(lambda: has(one, "outputs/voltage", 0.3))  # 0.6 ohm
            assert rig.client == "ppy rig opcua"
            await node(one, "inputs/force").write_value(2.0)
            await until(lambda: has(one, "inputs/force", 2.0))
            assert await has(one, "inputs/current", 0.5)
            await until(lambda: has(one, "inputs/current", 0.0))
            assert time.monotonic() - began > LEASE
            assert rig.state == "idle"
            assert len(rig.of_type("exchange")) >= 0.5 * LEASE / rig.period
            await node(one, "inputs/current").write_value(0.25)  # another session
            await until(lambda: has(one, "inputs/current", 0.25))
        assert rig.state == "idle", "the end of the bridge is the end of its session"

    asyncio.run(check())


@pytest.mark.parametrize(
    ("place", "written", "error"),
    [
        ("inputs/current", 1.4, "BadOutOfRange"),
        ("inputs/current", math.nan, "BadOutOfRange"),
        ("inputs/current", 1, "BadTypeMismatch"),
        ("outputs/voltage", 0.5, "BadNotWritable"),
        ("state", "safe", "BadNotWritable"),
    ],
)
def test_what_cannot_be_commanded_is_refused(
    rig: SmallRig, place: str, written: Any, error: str
) -> None:
    async def check() -> None:
        async with bridge(rig) as address, client(address, PASSWORD) as one:
            await until(lambda: has(one, "inputs/current", 0.0))
            with pytest.raises(getattr(ua.uaerrors, error)):
                await node(one, place).write_value(written)
            assert not rig.of_type("connect")

    asyncio.run(check())


def test_without_the_password_nobody_drives(rig: SmallRig) -> None:
    async def check() -> None:
        async with bridge(rig) as address:
            async with client(address) as one:
                await until(lambda: has(one, "inputs/current", 0.0))
                with pytest.raises(ua.uaerrors.BadUserAccessDenied):
                    await node(one, "inputs/current").write_value(0.5)
            with pytest.raises(ua.uaerrors.BadUserAccessDenied):
                await client(address, "a wrong one").connect()
        async with bridge(rig, "") as address:
            with pytest.raises(ua.uaerrors.BadUserAccessDenied):
                await client(address, "any").connect()
        assert not rig.of_type("connect")

    asyncio.run(check())


def test_a_rig_that_refuses_is_told_to_the_writer(
    rig: SmallRig, capsys: pytest.CaptureFixture[str]
) -> None:
    async def check() -> None:
        async with bridge(rig) as address, client(address, PASSWORD) as one:
            await until(lambda: has(one, "inputs/current", 0.0))
            rig.safe("door open")
            with pytest.raises(ua.uaerrors.BadInvalidState):
                await node(one, "inputs/current").write_value(0.5)
            assert "the rig is safe: door open" in capsys.readouterr().out
            rig.acknowledge()
            rig.unknown = {"force"}
            await asyncio.sleep(0.1)
            with pytest.raises(ua.uaerrors.BadInvalidState):
                await node(one, "inputs/current").write_value(0.5)
            assert "does not say what it has of force" in capsys.readouterr().out

    asyncio.run(check())


def test_a_rig_that_is_stopped_meanwhile_is_not_driven_again_by_itself(rig: SmallRig) -> None:
    async def check() -> None:
        async with bridge(rig) as address, client(address, PASSWORD) as one:
            await until(lambda: has(one, "inputs/current", 0.0))
            await node(one, "inputs/current").write_value(0.5)
            await until(lambda: has(one, "inputs/current", 0.5))
            rig.safe("button")
            rig.session = ""
            await until(lambda: has(one, "inputs/current", 0.0))
            await asyncio.sleep(0.1)
            rig.acknowledge()
            await asyncio.sleep(0.1)
            assert rig.state == "idle"

    asyncio.run(check())


def test_a_port_that_is_taken_is_told(rig: SmallRig) -> None:
    async def check() -> None:
        async with bridge(rig) as address:
            remote = read_endpoint(rig.endpoint)
            about = ask(remote, "status")
            second = Bridge(remote, about, Driver(remote, about, None, LEASE, print), "", print)
            with pytest.raises(UserError, match=f"cannot listen at {address}: "):
                await second.run(address, lambda: None)

    asyncio.run(check())
