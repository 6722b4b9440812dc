"""Claims: behind the server, hardware on a port is driven and brought to its safe state as any
other; a bridge to OPC UA drives with a key that may, and a rig stops whose bridge dies.

Devices are a pseudo-terminal, the server of pymodbus, and the emulated rig.
"""

from __future__ import annotations

import asyncio
import re
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua

from fmus.rig_proxy import Link
from orchestration.rig import add_client, ask, make_keys, read_endpoint
from tests.support.rig.modbus_device import CALIBRATION as REGISTERS
from tests.support.rig.modbus_device import tcp_device
from tests.support.rig.process import ROOT, Server
from tests.support.rig.small_rig import free_port

pytestmark = pytest.mark.slow
PATIENCE = 10.0  # s, for what takes a moment on an idle machine
PASSWORD = "correct horse"
SLOWLY = ("--rate", "20", "--watchdog", "1")


def until(claim: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not claim():
        assert time.monotonic() < end
        time.sleep(0.02)


def drive(server: Server, command: dict[str, float], arrived: Callable[[], bool]) -> None:
    """Command a rig until its device has it, then end the session."""
    about = ask(read_endpoint(server.wait_ready()), "status")
    link = Link(server.endpoint, about["inputs"], about["outputs"])
    try:
        link.connect(0.0, PATIENCE)
        values = [command[name] for name in link.inputs]
        until(lambda: bool(link.exchange(values, 0.0, 0.05, 0.2)) and arrived())
        link.disconnect()
    finally:
        link.close()


def state(server: Server) -> dict[str, Any]:
    return ask(read_endpoint(server.endpoint), "status")


@pytest.mark.skipif(sys.platform == "win32", reason="a pseudo-terminal needs POSIX")
def test_an_instrument_on_a_serial_port(tmp_path: Path) -> None:
    from tests.support.rig.wires import CALIBRATION, Instrument

    with Instrument() as supply:
        path = tmp_path / "supply.toml"
        path.write_text(CALIBRATION.format(port=supply.port))
        options: dict[str, object] = {"calibration": path}
        with Server(tmp_path, "serial", *SLOWLY, options=options) as server:
            drive(server, {"current": 1.0}, lambda: supply.current == 0.5)
            until(lambda: supply.current == 0.05)
            supply.answer = {"TEMP?": b""}
            until(lambda: state(server)["state"] == "safe")
            assert "no answer to TEMP?" in state(server)["reason"]


def test_a_device_of_modbus(tmp_path: Path) -> None:
    path = tmp_path / "device.toml"
    path.write_text(REGISTERS.replace("[0, 30000]", "[0, 50000]"))
    with tcp_device() as device:
        options: dict[str, object] = {"calibration": path, "port": device.port}
        with Server(tmp_path, "modbus", *SLOWLY, options=options) as server:
            command = {"current": 1.0, "flow": 0.5, "turns": 3.0, "valve": 1.0}
            drive(server, command, lambda: device.look(3, 10, 2) == struct.pack(">f", 0.5))
            until(lambda: device.look(3, 0, 1) == struct.pack(">h", 50))
            device.end()
            until(lambda: state(server)["state"] == "not reached")
            with tcp_device(device.port) as again:
                until(lambda: again.look(3, 0, 1) == struct.pack(">h", 50))
                until(lambda: state(server)["state"] == "safe")
                server.process.terminate()
                assert server.process.wait(PATIENCE) is not None


def bridge(server: Server, key: Path, folder: Path) -> tuple[subprocess.Popen[str], str]:
    """Start a bridge, and return it and its address when it is ready."""
    password = folder / "password.toml"
    password.write_text(f'password = "{PASSWORD}"')
    password.chmod(0o600)
    words = ("rig", "opcua", "--endpoint", server.endpoint, "--port", str(free_port()))
    words += ("--credentials", str(key), "--password", str(password))
    process = subprocess.Popen(
        [sys.executable, "-m", "orchestration.cli", *words],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    assert process.stdout is not None
    found = re.match(r"ready: (opc\.tcp://\S+)", process.stdout.readline())
    assert found is not None
    return process, found[1]


def test_a_bridge_to_opc_ua_drives_with_a_key_that_may_and_the_rig_stops_when_it_dies(
    tmp_path: Path,
) -> None:
    async def write(address: str) -> None:
        one = Client(address)
        one.set_user("operator")
        one.set_password(PASSWORD)
        async with one:
            current = one.get_node("ns=2;s=inputs/current")
            for _ in range(100):
                known = await current.read_data_value(raise_on_bad_status=False)
                if known.StatusCode.is_good():
                    break
                await asyncio.sleep(0.05)
            await current.write_value(0.2)
            voltage = one.get_node("ns=2;s=outputs/voltage")
            for _ in range(100):
                if await voltage.read_value() > 0.05:  # 0.2 A through some 0.5 ohm
                    return
                await asyncio.sleep(0.01)
            raise AssertionError("the command does not arrive")

    key, _ = make_keys(tmp_path / "keys")
    watcher = add_client(tmp_path / "keys", "wall", "watch")
    commander = add_client(tmp_path / "keys", "scada", "command")
    with Server(tmp_path, "emulator", "--keys", key, "--watchdog", "1") as server:
        server.wait_ready()
        remote = read_endpoint(server.endpoint, commander)
        process, address = bridge(server, watcher, tmp_path)
        with process:
            with pytest.raises(ua.uaerrors.BadInvalidState):
                asyncio.run(write(address))
            process.terminate()
            assert process.wait(PATIENCE) == 0
        process, address = bridge(server, commander, tmp_path)
        with process:
            asyncio.run(write(address))
            assert ask(remote, "status")["client"]
            process.kill()
        until(lambda: ask(remote, "status")["state"] == "safe")
        assert "no fresh command" in ask(remote, "status")["reason"]
