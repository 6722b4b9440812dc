"""Base of backends whose signals a calibration describes."""

from __future__ import annotations

from collections.abc import Mapping

from fmus.kit import UserError
from orchestration.plugins.calibration import read_calibration
from orchestration.rig.backends import Backend
from orchestration.rig.signals import commands


class Calibrated(Backend):
    """The signals of a calibration, with their units, limits and safe values.

    Parameters
    ----------
    calibration : str
        A file, or the name of one that ships.

    Raises
    ------
    UserError
        If the calibration is wrong.
    """

    def __init__(self, calibration: str) -> None:
        self._calibration = read_calibration(calibration)
        self._command_channels = self._calibration.inputs
        self._measured_channels = self._calibration.outputs
        self.inputs, self.outputs = self._calibration.units
        self.limits = self._calibration.limits
        line = self._calibration.heartbeat
        if line and type(self).heartbeat is Backend.heartbeat:
            raise UserError(
                f"{self._calibration.file}: [rig] heartbeat = {line!r}: there is no such line here"
            )
        self.attributes = self._calibration.attributes
        self.safe_values = {name: one.safe_value for name, one in self._command_channels.items()}

    def _volts(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the volts of every command.

        Raises
        ------
        UserError
            If a command is missing, unknown, not finite or beyond its channel's range.
        """
        checked = commands(values, self.inputs)
        return {name: one.volts(checked[name]) for name, one in self._command_channels.items()}
