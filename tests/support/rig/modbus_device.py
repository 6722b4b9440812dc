"""A device of Modbus: the server of pymodbus in a process, and a look into it by frames of hand.

As a program it takes the port of loopback or the serial port that it is at.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tests.support.rig.process import module_process
from tests.support.rig.small_rig import free_port

CALIBRATION = """
[rig]
rate = 20.0
watchdog = 0.4

[inputs.current]
channel = "holding 0 int16"
gain = 0.01
unit = "A"
range = [-1000, 1000]
safe = 0.5
date = 2026-11-29

[inputs.flow]
channel = "holding 10 float32"
gain = 1.0
unit = "m^3/s"
si = "m^3/s"
range = [0.0, 2.0]
date = 2026-11-29

[inputs.turns]
channel = "holding 20 int32 little"
gain = 1.0
unit = "1"
range = [-1e5, 1e5]
date = 2026-11-29

[inputs.valve]
channel = "coil 1"
gain = 1.0
unit = "1"
range = [0, 1]
date = 2026-11-29

[outputs.temperature]
channel = "input 0 int16"
gain = 0.1
unit = "degC"
si = "K"
range = [-2000, 2000]
date = 2026-11-29

[outputs.level]
channel = "input 30 uint16"
gain = 1e-4
unit = "m"
range = [0, 30000]
date = 2026-11-29

[outputs.door]
channel = "discrete 0"
gain = 1.0
unit = "1"
range = [0, 1]
date = 2026-11-29
"""
WORDS = {  # of holding registers and of input registers
    0: struct.unpack(">H", struct.pack(">h", -250)),  # int16
    10: struct.unpack(">2H", struct.pack(">f", 0.75)),  # float32
    20: struct.unpack(">2H", struct.pack(">i", -70000))[::-1],  # int32, the low word first
    30: (40000,),  # uint16
}


@dataclass
class Device:
    """A device, and the process that it is.

    Attributes
    ----------
    port : str
        As a backend wants it.
    """

    port: str
    process: subprocess.Popen[str]

    def end(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait()

    def look(self, function: int, address: int, count: int) -> bytes:
        """Return the data of an answer to a request of the standard, by its bytes alone."""
        host, _, port = self.port.removeprefix("tcp://").partition(":")
        with socket.create_connection((host, int(port)), 5.0) as line:
            line.sendall(struct.pack(">HHHBBHH", 7, 0, 6, 1, function, address, count))
            answer = line.recv(260)
        assert answer[7] == function
        return answer[9:]


@contextlib.contextmanager
def tcp_device(place: str = "") -> Iterator[Device]:
    """A device on loopback, where another one was or at a free port."""
    place = place or f"tcp://127.0.0.1:{free_port()}"
    with module_process(__name__, place.rpartition(":")[2]) as process:
        yield Device(place, process)


@contextlib.contextmanager
def line_device() -> Iterator[Device]:
    """A device on a line: whatever one pseudo-terminal's master gets goes to the other's."""
    import pty
    import tty

    pairs = [pty.openpty() for _ in range(2)]
    for _, slave in pairs:
        tty.setraw(slave)
    (one, far), (other, near) = pairs
    for source, target in ((one, other), (other, one)):
        threading.Thread(target=_carry, args=(source, target), daemon=True).start()
    with module_process(__name__, os.ttyname(far)) as process:
        yield Device(os.ttyname(near), process)
    for slave in (far, near):
        os.close(slave)


def _carry(source: int, target: int) -> None:
    with contextlib.suppress(OSError):  # the other end of the terminal was closed
        while data := os.read(source, 260):
            os.write(target, data)


async def main(place: str) -> None:
    """Serve until killed."""
    words = [
        SimData(address, values=list(values), datatype=DataType.REGISTERS)
        for address, values in WORDS.items()
    ]
    bits = [SimData(0, values=[True, False] * 8, datatype=DataType.BITS)]
    memory = SimDevice(1, (bits, bits, words, words))
    server: ModbusTcpServer | ModbusSerialServer
    if place.isdecimal():
        server = ModbusTcpServer(memory, address=("127.0.0.1", int(place)))
    else:
        server = ModbusSerialServer(memory, port=place, baudrate=19200)
    await server.listen()
    print("ready", flush=True)
    await server.serving


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
