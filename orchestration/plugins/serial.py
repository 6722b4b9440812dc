"""Backend of instruments on serial ports: one line out, one line in."""

from __future__ import annotations

import os

import serial

from fmus.kit import UserError
from orchestration.plugins.calibration import Instrument, read_calibration
from orchestration.plugins.messages import Instruments
from orchestration.rig.backends import place


class Serial(Instruments):
    """The instruments that a calibration lists, by their serial ports.

    A port is a device of the system, such as ``/dev/ttyUSB0`` or ``COM3``, or a URL of pyserial,
    such as ``socket://host:port``.
    """

    @classmethod
    def devices(cls, calibration: str = "", **options: str) -> list[str]:
        """Return the ports, under the name that they have whatever link leads to them."""
        instruments = read_calibration(calibration).instruments
        return sorted({port_name(one.resource) for one in instruments.values()})

    def _connect(self, instrument: Instrument) -> _Line:
        return _Line(instrument)


class _Line:
    """A serial port, as a session with an instrument.

    Parameters
    ----------
    instrument : Instrument
    """

    def __init__(self, instrument: Instrument) -> None:
        if instrument.baudrate is None:
            raise UserError("its baudrate is missing")
        framing = instrument.framing
        self._end = instrument.termination.encode()
        self._port = serial.serial_for_url(
            instrument.resource,
            instrument.baudrate,
            bytesize=int(framing[0]),
            parity=framing[1],
            stopbits=int(framing[2]),
            timeout=instrument.timeout,
            write_timeout=instrument.timeout,
        )
        self.clear = self._port.reset_input_buffer
        self.close = self._port.close

    def write(self, message: str) -> None:
        """Send a line."""
        self._port.write(message.encode() + self._end)

    def query(self, message: str) -> str:
        """Send a line, and return the next one that arrives; TimeoutError without one in time."""
        self.clear()  # an answer that came too late is not the one to this message
        self.write(message)
        answer: bytes = self._port.read_until(self._end)
        if not answer.endswith(self._end):
            raise TimeoutError(f"{answer[:40]!r} within {self._port.timeout:g} s")
        return answer.decode()


def port_name(port: str) -> str:
    """Return the name by which servers on a machine know that a serial port is taken."""
    return f"serial port {place(os.path.normcase(port))}"
