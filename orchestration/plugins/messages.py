"""Base of backends of instruments: they exchange the messages of a calibration, over any line."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from typing import Protocol

from fmus.kit import UserError
from orchestration.plugins.calibrated import Calibrated
from orchestration.plugins.calibration import Channel, Instrument

_MOST_ERRORS = 20  # that an instrument keeps


class Session(Protocol):
    """An open line to an instrument; every call may raise any exception."""

    def write(self, message: str, /) -> object:
        """Send a message."""

    def query(self, message: str, /) -> str:
        """Send a message, and return the answer to it."""

    def clear(self) -> object:
        """Drop whatever is on its way."""

    def close(self) -> object:
        """Close the line; the instrument stays as it is."""


class Instruments(Calibrated):
    """The instruments that a calibration lists; opening sends them their setup.

    Parameters
    ----------
    calibration : str
        A file, or the name of one that ships.

    Raises
    ------
    UserError
        If the calibration is wrong, or an instrument does not answer or reports an error.
    """

    def __init__(self, calibration: str) -> None:
        super().__init__(calibration)
        for channel in (*self._command_channels.values(), *self._measured_channels.values()):
            if not channel.instrument:
                raise UserError(
                    f"{calibration}: {channel.name} is a channel of a device, not of an instrument"
                )
        self._sessions: dict[str, Session] = {}
        self._sent: dict[str, str] = {}  # signal -> message that the instrument took last
        try:
            for name, instrument in self._calibration.instruments.items():
                self._open(name, instrument)
        except BaseException:
            self.close()
            raise

    @abstractmethod
    def _connect(self, instrument: Instrument) -> Session:
        """Open the line to an instrument; any exception is told as the reason of a refusal."""

    def _open(self, name: str, instrument: Instrument) -> None:
        """Open the session with an instrument, send its setup, and check it for errors."""
        if instrument.timeout >= self._calibration.watchdog:
            raise UserError(
                f"{self._calibration.file}: [instruments.{name}] timeout = {instrument.timeout:g}:"
                f" must be below the watchdog, {self._calibration.watchdog:g} s"
            )
        try:
            self._sessions[name] = self._connect(instrument)
        except Exception as error:  # of the line's library, or of whichever that one uses
            raise UserError(
                f"{name} ({instrument.resource}) cannot be opened: {one_line(error)}"
            ) from error
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
            name: self._query(channel, channel.message)
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
        found = self._calibration.instruments[channel.place].answer.search(answer)
        try:
            volts = float(found[1] if found else "")
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
        messages = {
            name: _message(self._command_channels[name], volts)
            for name, volts in self._volts(values).items()
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
                volts = channel.volts(self.safe_values[name])
                self._insist(channel.place, _message(channel, volts))
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
        """Send a message; if it does not get through, clear the line and send it again."""
        try:
            self._send(place, message)
            self._check(place)
        except UserError:
            with suppress(Exception):  # not every line can be cleared
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

    def _session(self, place: str) -> Session:
        if place not in self._sessions:
            raise UserError(f"{place}: is closed")
        return self._sessions[place]

    def _send(self, place: str, message: str) -> None:
        """Send a message, and take the reply to it where the instrument gives one to each."""
        expected = self._calibration.instruments[place].reply
        if expected is not None:
            reply = self._ask(place, message)
            if not expected.fullmatch(reply):
                raise UserError(
                    f"{place}: replies {reply[:40]!r} to {message}; wanted is {expected.pattern}"
                )
            return
        session = self._session(place)
        try:
            session.write(message)
        except Exception as error:
            raise UserError(f"{place}: {message} was not taken: {one_line(error)}") from error

    def _ask(self, place: str, message: str) -> str:
        session = self._session(place)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # pyvisa only warns of an answer that is cut off
                return session.query(message).strip()
        except Exception as error:
            raise UserError(f"{place}: no answer to {message}: {one_line(error)}") from error

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


def _message(channel: Channel, volts: float) -> str:
    """Return the message that commands an instrument."""
    return channel.message.format(volts=volts + 0.0)  # no -0


def one_line(error: Exception) -> str:
    """Return the text of an error of a library in one line of bounded length."""
    return " ".join(str(error).split())[:300]
