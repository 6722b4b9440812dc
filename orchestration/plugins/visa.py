"""Backend of bench instruments that understand messages (SCPI), through VISA.

A function generator that drives the galvanostat is one of them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import suppress

import pyvisa
from pyvisa.errors import Error
from pyvisa.resources import MessageBasedResource

from fmus.kit import UserError
from orchestration.rig.backends import Backend, Limit
from orchestration.rig.calibration import Channel, Instrument, read_calibration
from orchestration.rig.signals import commands

_MOST_ERRORS = 20  # that an instrument keeps
_CALIBRATION = "thesis_generator"


class Visa(Backend):
    """The instruments that a calibration lists; opening sends them their setup.

    Parameters
    ----------
    calibration : str
        A file, or the name of one that ships.
    library : str
        VISA library, in pyvisa's notation: empty for the installed one, ``@py`` for pyvisa-py.

    Raises
    ------
    UserError
        If the calibration is wrong, or there is no VISA library, or an instrument does not answer
        or reports an error.
    """

    def __init__(self, calibration: str = _CALIBRATION, library: str = "") -> None:
        self._calibration = read_calibration(calibration)
        self._command_channels = self._calibration.inputs
        self._measured_channels = self._calibration.outputs
        for channel in (*self._command_channels.values(), *self._measured_channels.values()):
            if not channel.command:
                raise UserError(
                    f"{calibration}: {channel.name} is a channel of a device, not of an instrument"
                )
        self.inputs, self.outputs = self._calibration.units
        self.limits: Mapping[str, Limit] = self._calibration.limits
        self.safe_values = {name: one.safe for name, one in self._command_channels.items()}
        self._sessions: dict[str, MessageBasedResource] = {}
        self._sent: dict[str, str] = {}  # signal -> message that the instrument took last
        self._manager: pyvisa.ResourceManager | None = None
        try:
            self._manager = pyvisa.ResourceManager(library)
        except Exception as error:  # ValueError, OSError or its own, by the missing part
            raise UserError(
                f"no VISA library: {_one_line(error)}; install one, or write library=@py"
            ) from error
        try:
            for name, instrument in self._calibration.instruments.items():
                self._open(name, instrument, self._manager)
        except BaseException:
            self.close()
            raise

    @classmethod
    def devices(cls, calibration: str = _CALIBRATION, **options: str) -> list[str]:
        """Return the resources of the instruments."""
        instruments = read_calibration(calibration).instruments
        return sorted({f"VISA resource {one.resource.upper()}" for one in instruments.values()})

    def _open(self, name: str, instrument: Instrument, manager: pyvisa.ResourceManager) -> None:
        """Open the session with an instrument, send its setup, and check it for errors."""
        wait = round(1000 * instrument.timeout)
        try:
            session = manager.open_resource(
                instrument.resource,
                open_timeout=wait,
                timeout=wait,
                read_termination=instrument.termination,
                write_termination=instrument.termination,
            )
        except Exception as error:  # of pyvisa, or of whichever library it uses
            raise UserError(
                f"{name} ({instrument.resource}) cannot be opened: {_one_line(error)}"
            ) from error
        if not isinstance(session, MessageBasedResource):
            session.close()
            raise UserError(f"{name} ({instrument.resource}): understands no messages")
        self._sessions[name] = session
        for message in instrument.setup:
            self._send(name, message)
        self._check(name)

    def read(self) -> Mapping[str, float]:
        """Query every instrument; NaN where an answer makes no sense.

        Returns
        -------
        Mapping of str to float

        Raises
        ------
        UserError
            If an instrument does not answer in time, or with something that is no number.
        """
        return {
            name: self._query(channel, channel.command)
            for name, channel in self._measured_channels.items()
        }

    def read_back(self) -> Mapping[str, float]:
        """Query every instrument that can report its command.

        Returns
        -------
        Mapping of str to float

        Raises
        ------
        UserError
            If an instrument does not answer in time, or with something that is no number.
        """
        asked = {name: channel for name, channel in self._command_channels.items() if channel.query}
        return {name: self._query(channel, channel.query) for name, channel in asked.items()}

    def _query(self, channel: Channel, message: str) -> float:
        """Return the value that an instrument answers a message with."""
        answer = self._ask(channel.place, message)
        try:
            volts = float(answer.split(",")[0])
        except ValueError as error:
            raise UserError(
                f"{channel.place}: answers {answer[:40]!r} to {message}, which is no number"
            ) from error
        return channel.measured(volts)  # an overload, 9.9e37 in SCPI, is beyond any range

    def write(self, values: Mapping[str, float]) -> None:
        """Send every command that has changed, and ask each instrument whether it was accepted.

        Raises
        ------
        UserError
            If a command is missing, unknown, not finite or beyond its channel's range, which sends
            nothing, or an instrument refuses one or does not answer.
        """
        checked = commands(values, self.inputs)
        messages = {
            name: _message(channel, checked[name])
            for name, channel in self._command_channels.items()
        }
        for name, message in messages.items():
            if self._sent.get(name) == message:
                continue
            place = self._command_channels[name].place
            self._sent.pop(name, None)
            self._send(place, message)
            self._check(place)
            self._sent[name] = message

    def safe(self) -> None:
        """Send all safe values and messages; an instrument that fails does not stop the others.

        Raises
        ------
        UserError
            If an instrument did not take it, after a second try.
        """
        if not self._sessions:
            return
        errors: list[UserError] = []
        for name, channel in self._command_channels.items():
            try:
                self._insist(channel.place, _message(channel, channel.safe))
                self._sent.pop(name, None)
            except UserError as error:
                errors.append(error)
        for name, instrument in self._calibration.instruments.items():
            for message in instrument.safe:
                try:
                    self._insist(name, message)
                except UserError as error:
                    errors.append(error)
        if errors:
            raise errors[0]

    def _insist(self, place: str, message: str) -> None:
        """Send a message; if it does not get through, clear the interface and send it again."""
        try:
            self._send(place, message)
            self._check(place)
        except UserError:
            with suppress(Exception):  # not every interface can be cleared
                self._sessions[place].clear()
            self._send(place, message)
            self._check(place)

    def close(self) -> None:
        """Close the sessions with the instruments, which stay as they are."""
        sessions = self._sessions
        self._sessions = {}
        for session in sessions.values():
            with suppress(Exception):
                session.close()
        manager = self._manager
        self._manager = None
        if manager is not None:
            with suppress(Exception):
                manager.close()

    def _session(self, place: str) -> MessageBasedResource:
        if place not in self._sessions:
            raise UserError(f"{place}: is closed")
        return self._sessions[place]

    def _send(self, place: str, message: str) -> None:
        try:
            self._session(place).write(message)
        except (Error, OSError) as error:
            raise UserError(f"{place}: {message} was not taken: {_one_line(error)}") from error

    def _ask(self, place: str, message: str) -> str:
        session = self._session(place)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # pyvisa only warns of an answer that is cut off
                return str(session.query(message)).strip()
        except (Error, OSError, UnicodeDecodeError, UserWarning) as error:
            raise UserError(f"{place}: no answer to {message}: {_one_line(error)}") from error

    def _check(self, place: str) -> None:
        """Query an instrument's queue of errors until it is empty; raise the first one."""
        query = self._calibration.instruments[place].error
        if not query:
            return
        first = ""
        for _ in range(_MOST_ERRORS):
            answer = self._ask(place, query)
            if answer.lstrip("+-").split(",")[0].strip() == "0":
                break
            first = first or answer
        if first:
            raise UserError(f"{place}: reports {first[:100]}")


def _message(channel: Channel, value: float) -> str:
    """Return the message that commands an instrument to a value, SI."""
    return channel.command.format(volts=channel.volts(value) + 0.0)  # no -0


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
