"""Cutting a system open at its measured signals: what each member is fed, and what of it can be judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.systems.reason import Reason, ReasonCode
from orchestration.fmu.signal import Signal
from orchestration.system.check import interface
from orchestration.system.model import Connection, Member, Port, System

Array = NDArray[np.float64]


class InputOrigin(StrEnum):
    """Where the values of an input are from."""

    MEASURED = "measured"  # at the input itself
    UPSTREAM = "upstream"  # measured at the output that feeds it
    SETTING = "setting"  # of the user
    DEFAULT = "value in the system"


@dataclass(frozen=True)
class InputSource:
    """What an input of a member gets while it is judged: either values that were measured, or one value throughout.

    Attributes
    ----------
    origin : InputOrigin
    signal : Port or None
        Where it was measured; None if it stays at a value.
    values : ndarray, shape (n,), or None
        Measured, in the unit of the input; None if it stays at a value.
    value : float or None
        At which it stays.
    continuous : bool
        Whether it may change between samples, so that holding and interpolating differ.
    """

    origin: InputOrigin
    signal: Port | None = None
    values: Array | None = None
    value: float | None = None
    continuous: bool = False


@dataclass(frozen=True)
class IsolatedMember:
    """A member cut out of its system where it was measured.

    Attributes
    ----------
    member : Member
    inputs : dict of str to InputSource
    outputs : dict of str to ndarray, shape (n,)
        What was measured of its real outputs, in their units; NaN where nothing was.
    missing : dict of str to Reason
        Inputs of which not enough is known, each with the signal to measure.
    """

    member: Member
    inputs: dict[str, InputSource]
    outputs: dict[str, Array]
    missing: dict[str, Reason]

    @property
    def reason_not_assessable(self) -> list[Reason]:
        """Why nothing can be said of it; empty if something can."""
        if self.missing:
            return list(self.missing.values())
        return [] if self.outputs else [Reason(ReasonCode.NO_OUTPUT_MEASURED)]


def isolated_members(
    system: System, measured: Mapping[Port, Array], given: Mapping[Port, float]
) -> list[IsolatedMember]:
    """Cut a system open at its measured signals.

    Parameters
    ----------
    system : System
    measured : Mapping of Port to ndarray, shape (n,)
    given : Mapping of Port to float
        Values of inputs that are known to have stayed where they were.

    Returns
    -------
    list of IsolatedMember
        One for each member.
    """
    everywhere = dict(measured)
    for c in system.connections:  # an output that was measured where it arrives
        if c.source not in everywhere and c.target in everywhere and c.factor:
            everywhere[c.source] = (everywhere[c.target] - c.offset) / c.factor
    for ports in system.inputs.values():
        there = [everywhere[port] for port in ports if port in everywhere]
        everywhere |= {port: there[0] for port in ports if port not in everywhere and there}
    return [_isolated(system, member, everywhere, given) for member in system.members]


def _isolated(
    system: System, member: Member, measured: Mapping[Port, Array], given: Mapping[Port, float]
) -> IsolatedMember:
    model = interface(member)
    arriving = {c.target: c for c in system.connections}
    outer = {port: name for name, ports in system.inputs.items() for port in ports}
    inputs, missing = dict[str, InputSource](), dict[str, Reason]()
    for name, signal in model.inputs.items():
        port = Port(member.name, name)
        connection = arriving.get(port)
        default = (
            None
            if connection is not None or port in outer
            else float(member.parameters.get(name, signal.start))
        )
        source = _source(port, signal, connection, measured, given.get(port), default)
        if source is None:
            wanted = str(connection.source) if connection else outer[port]
            missing[name] = Reason(ReasonCode.INPUT_NOT_MEASURED, {"input": name, "signal": wanted})
        elif source.values is not None and not np.isfinite(source.values).all():
            missing[name] = Reason(
                ReasonCode.INPUT_WITH_GAPS, {"input": name, "signal": str(source.signal)}
            )
        else:
            inputs[name] = source
    real = [name for name, signal in model.outputs.items() if signal.type == "real"]
    outputs = {name: measured[p] for name in real if (p := Port(member.name, name)) in measured}
    return IsolatedMember(
        member, inputs, {n: y for n, y in outputs.items() if np.isfinite(y).any()}, missing
    )


def _source(
    port: Port,
    signal: Signal,
    connection: Connection | None,
    measured: Mapping[Port, Array],
    given: float | None,
    default: float | None,
) -> InputSource | None:
    """The best that is known of an input; None if nothing is."""
    continuous = signal.type == "real"
    if port in measured:
        return InputSource(InputOrigin.MEASURED, port, measured[port], continuous=continuous)
    if connection is not None and connection.source in measured:
        values = connection.factor * measured[connection.source] + connection.offset
        return InputSource(InputOrigin.UPSTREAM, connection.source, values, continuous=continuous)
    if given is not None:
        return InputSource(InputOrigin.SETTING, value=given)
    return None if default is None else InputSource(InputOrigin.DEFAULT, value=default)
