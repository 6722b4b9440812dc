"""Backend of bench instruments that understand messages (SCPI), through VISA.

A function generator that drives the galvanostat is one of them.
"""

from __future__ import annotations

from contextlib import suppress

import pyvisa
from pyvisa.resources import MessageBasedResource

from fmus.kit import UserError
from orchestration.plugins.calibration import Instrument, read_calibration
from orchestration.plugins.messages import Instruments, Session, one_line

_CALIBRATION = "thesis_generator"


class Visa(Instruments):
    """The instruments that a calibration lists, by their VISA addresses.

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
        try:
            self._manager = pyvisa.ResourceManager(library)
        except Exception as error:  # ValueError, OSError or its own, by the missing part
            raise UserError(
                f"no VISA library: {one_line(error)}; install one, or write library=@py"
            ) from error
        super().__init__(calibration)

    @classmethod
    def devices(cls, calibration: str = _CALIBRATION, **options: str) -> list[str]:
        """Return the resources of the instruments."""
        instruments = read_calibration(calibration).instruments
        return sorted({f"VISA resource {one.resource.upper()}" for one in instruments.values()})

    def _connect(self, instrument: Instrument) -> Session:
        if instrument.baudrate is not None:
            raise UserError("baudrate is of a serial port, which --backend serial opens")
        wait = round(1000 * instrument.timeout)
        session = self._manager.open_resource(
            instrument.resource,
            open_timeout=wait,
            timeout=wait,
            read_termination=instrument.termination,
            write_termination=instrument.termination,
        )
        if not isinstance(session, MessageBasedResource):
            session.close()
            raise UserError("understands no messages")
        return session

    def close(self) -> None:
        """Close the sessions with the instruments, which stay as they are."""
        super().close()
        with suppress(Exception):
            self._manager.close()
