"""Driver for clients of a bridge, at a small rig that shares no code with ours."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from fmus.kit.errors import UserError
from orchestration.plugins.driver import Driver, read_password
from orchestration.rig import ask, read_endpoint
from tests.support.rig.small_rig import SmallRig

LEASE = 0.3  # s
PATIENCE = 5.0  # s, for what takes milliseconds on an idle machine
PASSWORD = "correct horse"
REST = {"current": 0.0, "force": 0.0}


@pytest.fixture
def rig() -> Iterator[SmallRig]:
    with SmallRig(watchdog=0.2) as one:
        yield one


def drive(
    rig: SmallRig, act: Callable[[Driver, list[str]], Coroutine[Any, Any, None]]
) -> list[str]:
    """Run what is done with a driver beside it; return its notes."""
    notes: list[str] = []

    async def run() -> None:
        remote = read_endpoint(rig.endpoint)
        driver = Driver(remote, ask(remote, "status"), None, LEASE, notes.append)
        task = asyncio.create_task(driver.run())
        await act(driver, notes)
        task.cancel()
        await driver.release()

    asyncio.run(run())
    return notes


async def until(claim: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not claim():
        assert time.monotonic() < end
        await asyncio.sleep(0.01)


def commanded(rig: SmallRig) -> dict[str, float]:
    return rig.applied[-1][1]


def test_a_value_is_commanded_until_none_was_written_for_a_while(rig: SmallRig) -> None:
    async def act(driver: Driver, notes: list[str]) -> None:
        await driver.write({"current": 0.5}, REST | {"force": 1.0})
        began = time.monotonic()
        await until(lambda: commanded(rig) == {"current": 0.5, "force": 1.0})
        await driver.write({"force": 2.0}, REST)
        await until(lambda: commanded(rig) == {"current": 0.5, "force": 2.0})
        await until(lambda: rig.state == "idle")
        assert time.monotonic() - began > LEASE
        await until(lambda: commanded(rig) == REST)

    assert drive(rig, act) == ["nothing was written for 0.3 s: the rig is driven no more"]
    assert len(rig.of_type("disconnect")) == 1


def test_the_watchdog_of_the_rig_trips_when_the_driver_is_gone(rig: SmallRig) -> None:
    async def act(driver: Driver, notes: list[str]) -> None:
        await driver.write({"current": 0.5}, REST)
        await until(lambda: commanded(rig)["current"] == 0.5)
        (task,) = (one for one in asyncio.all_tasks() if "Driver.run" in str(one.get_coro()))
        task.cancel()
        await until(lambda: rig.state == "safe")
        assert rig.reason == "no command for 0.2 s"

    drive(rig, act)


def test_a_refusal_ends_the_session_and_the_next_write_begins_another(rig: SmallRig) -> None:
    async def act(driver: Driver, notes: list[str]) -> None:
        await driver.write({"current": 0.5}, REST)
        await until(lambda: commanded(rig)["current"] == 0.5)
        rig.session = ""  # as after an acknowledgement
        await until(lambda: len(notes) == 1)
        assert "no such session" in notes[0]
        await driver.write({"current": 0.25}, REST)
        await until(lambda: commanded(rig)["current"] == 0.25)

    drive(rig, act)


def test_what_the_rig_refuses_at_once_is_told_to_the_writer(rig: SmallRig) -> None:
    async def act(driver: Driver, notes: list[str]) -> None:
        with pytest.raises(UserError, match="does not say what it has of force"):
            await driver.write({"current": 0.5}, {"current": 0.0, "force": None})
        rig.safe("door open")
        with pytest.raises(UserError, match="refuses: the rig is safe: door open"):
            await driver.write({"current": 0.5}, REST)

    assert drive(rig, act) == []
    assert not rig.of_type("exchange")


@pytest.mark.parametrize(
    ("text", "host", "reason"),
    [
        ('password = "short"', "127.0.0.1", "password: a text of at least 8 characters is wanted"),
        ("password = 12345678", "127.0.0.1", "password: a text of at least 8 characters"),
        ("", "127.0.0.1", "password: a text of at least 8 characters"),
        ('password = "long enough"', "0.0.0.0", "--bind 0.0.0.0: has to be 127.0.0.1 with"),
    ],
)
def test_a_password_that_is_none_is_told(tmp_path: Path, text: str, host: str, reason: str) -> None:
    path = tmp_path / "password.toml"
    path.write_text(text)
    with pytest.raises(UserError, match=reason):
        read_password(path, host, print)


def test_the_password_is_that_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "password.toml"
    path.write_text(f'password = "{PASSWORD}"')
    assert read_password(path, "127.0.0.1", print) == PASSWORD
    assert read_password(None, "0.0.0.0", print) == ""
