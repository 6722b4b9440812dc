"""Backend of a device of Modbus, over TCP or a serial line (RTU): its registers and coils."""

from __future__ import annotations

import re
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from pymodbus import ModbusException
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from fmus.kit import UserError
from orchestration.plugins.calibrated import Calibrated
from orchestration.plugins.registers import Place
from orchestration.plugins.serial import port_name
from orchestration.rig.signals import integer, one_of, seconds

_TCP = re.compile(r"tcp://([^:/]+):(\d{1,5})")


class Modbus(Calibrated):
    """The registers and coils that a calibration lists; opening changes none.

    Parameters
    ----------
    calibration : str
        A file, or the name of one that ships.
    port : str
        ``tcp://HOST:PORT``, or a serial port.
    unit : str
        Address of the device on its line.
    timeout : str
        s, of every request; at most half the watchdog of the calibration.
    baudrate, parity : str
        Of a serial port; the defaults are those of Modbus over Serial Line 1.02, section 3.2.
    """

    def __init__(
        self,
        calibration: str,
        port: str,
        unit: str = "1",
        timeout: str = "0.1",
        baudrate: str = "19200",
        parity: str = "E",
    ) -> None:
        super().__init__(calibration)
        self._commanded = {
            name: Place(one, written=True) for name, one in self._command_channels.items()
        }
        self._measured = {name: Place(one) for name, one in self._measured_channels.items()}
        self._port, self._unit = port, integer("unit", unit)
        wait = seconds("timeout", timeout, 0.5 * self._calibration.watchdog)
        one_of("parity", parity, ("N", "E", "O"))
        tcp, rate = _TCP.fullmatch(port), integer("baudrate", baudrate)
        self._client: Any = (
            ModbusTcpClient(tcp[1], port=int(tcp[2]), timeout=wait, retries=0)
            if tcp
            else ModbusSerialClient(port, baudrate=rate, parity=parity, timeout=wait, retries=0)
        )
        self._is_open = self._client.connect()
        if not self._is_open:
            raise UserError(f"port = {port!r}: no connection within {wait:g} s")

    @classmethod
    def devices(cls, port: str = "", unit: str = "1", **options: str) -> list[str]:
        """Return the serial port, or the unit at the address that a host has."""
        tcp = _TCP.fullmatch(port)
        if tcp is None:
            return [port_name(port)]
        host = tcp[1]
        with suppress(OSError):
            host = socket.gethostbyname(host)
        return [f"Modbus {host}:{tcp[2]} unit {unit}"]

    def read(self) -> Mapping[str, float]:
        """Return every output, SI; NaN beyond the range of its channel."""
        return {name: self._read(place) for name, place in self._measured.items()}

    def read_back(self) -> Mapping[str, float]:
        """Return every input, SI, as the device has it."""
        return {name: self._read(place) for name, place in self._commanded.items()}

    def write(self, values: Mapping[str, float]) -> None:
        """Write every command; nothing if one is missing or beyond its channel's range."""
        for name, number in self._volts(values).items():
            self._write(self._commanded[name], number)

    def safe(self) -> None:
        """Write all safe values; UserError if one does not arrive over a new connection either."""
        errors: list[UserError] = []
        for place in self._commanded.values() if self._is_open else ():
            try:
                self._insist(place, place.channel.volts(self.safe_values[place.channel.name]))
            except UserError as error:
                errors.append(error)
        if errors:
            raise errors[0]

    def close(self) -> None:
        """Close the connection; the device stays as it is."""
        self._is_open = False
        self._client.close()

    def _insist(self, place: Place, number: float) -> None:
        try:
            self._write(place, number)
        except UserError:
            self._client.close()  # the next request connects anew
            self._write(place, number)

    def _read(self, place: Place) -> float:
        answer = self._ask(place.reads, place, count=place.count)
        return place.channel.measured(place.decode(answer))

    def _write(self, place: Place, number: float) -> None:
        values = place.encode(number)
        if place.count == 1:  # a request that even the smallest device knows
            self._ask(place.writes, place, *values)
        else:
            self._ask("write_registers", place, values)

    def _ask(self, request: str, place: Place, *value: Any, **count: int) -> Any:
        """Return the answer to a request; UserError if there is none, or it is a refusal."""
        where = f"{self._port}: {request} {place.channel.place}"
        if not self._is_open:
            raise UserError(f"{where}: is closed")
        call = getattr(self._client, request)
        try:
            answer = call(place.address, *value, device_id=self._unit, **count)
        except (ModbusException, OSError) as error:
            raise UserError(f"{where}: no answer: {error}") from error
        if answer.isError():
            raise UserError(f"{where}: refused: {answer}")
        return answer
