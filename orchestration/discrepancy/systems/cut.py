"""Isolation of the members of a system: each is cut out at its measured signals, or cannot be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu import Signal
from orchestration.system import Connection, Member, Port, System, interface


class ReasonCode(StrEnum):
    """Kind of a reason for a verdict on a member; `report.system_wording` says it in words."""

    # nothing can be said
    INPUT_NOT_MEASURED = "input_not_measured"
    INPUT_WITH_GAPS = "input_with_gaps"
    NO_OUTPUT_MEASURED = "no_output_measured"
    SIMULATION_FAILED = "simulation_failed"
    LOOP_SIMULATION_FAILED = "loop_simulation_failed"
    TOO_UNCERTAIN = "too_uncertain"
    NOT_EXCITED = "not_excited"
    # something is wrong
    RESIDUAL_BEYOND_NOISE = "residual_beyond_noise"
    PARAMETERS_CHANGED = "parameters_changed"
    CAUSE_NAMED = "cause_named"
    # nothing is wrong
    RESIDUAL_IS_NOISE = "residual_is_noise"
    OUTPUTS_UNMOVED = "outputs_unmoved"


@dataclass(frozen=True)
class Reason:
    """One reason for a verdict.

    Attributes
    ----------
    code : ReasonCode
    facts : Mapping of str to Any
        Figures, names and items that its sentence needs.
    """

    code: ReasonCode
    facts: Mapping[str, Any] = field(default_factory=dict)


class InputOrigin(StrEnum):
    """Origin of the values of an input."""

    MEASURED = "measured"  # at the input itself
    UPSTREAM = "upstream"  # measured at the output that feeds it
    SETTING = "setting"  # of the user
    DEFAULT = "value in the system"


@dataclass(frozen=True)
class InputSource:
    """Source of an input of a member while it is judged: measured values, or one value throughout.

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
        Those of its real outputs that were measured, in their units; NaN where nothing was.
    missing : dict of str to Reason
        Inputs of which not enough is known, each with the signal to measure.
    """

    member: Member
    inputs: dict[str, InputSource]
    outputs: dict[str, Array]
    missing: dict[str, Reason]

    @property
    def reason_not_assessable(self) -> list[Reason]:
        """Reasons why nothing can be said of it; empty if something can."""
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
    known = dict(measured)
    for connection in system.connections:  # an output that was measured where it arrives
        source = connection.source
        target = connection.target
        if source not in known and target in known and connection.factor:
            known[source] = (known[target] - connection.offset) / connection.factor
    for ports in system.inputs.values():
        values = next((known[port] for port in ports if port in known), None)
        if values is not None:
            known |= {port: values for port in ports if port not in known}
    return [_isolated(system, member, known, given) for member in system.members]


def _isolated(
    system: System, member: Member, measured: Mapping[Port, Array], given: Mapping[Port, float]
) -> IsolatedMember:
    """Cut one member out; what it is fed comes from the best source that is known."""
    model = interface(member)
    feeding = {c.target: c for c in system.connections}
    outer = {port: name for name, ports in system.inputs.items() for port in ports}
    inputs = dict[str, InputSource]()
    missing = dict[str, Reason]()
    for name, signal in model.inputs.items():
        port = Port(member.name, name)
        connection = feeding.get(port)
        default = None
        if connection is None and port not in outer:
            default = float(member.parameters.get(name, signal.start))
        source = _source(port, signal, connection, measured, given.get(port), default=default)
        if source is None:
            absent = str(connection.source) if connection else outer[port]
            facts = {"input": name, "signal": absent}
            missing[name] = Reason(ReasonCode.INPUT_NOT_MEASURED, facts)
        elif source.values is not None and not np.isfinite(source.values).all():
            facts = {"input": name, "signal": str(source.signal)}
            missing[name] = Reason(ReasonCode.INPUT_WITH_GAPS, facts)
        else:
            inputs[name] = source
    outputs = {}
    for name, signal in model.outputs.items():
        values = measured.get(Port(member.name, name))
        if signal.type == "real" and values is not None and np.isfinite(values).any():
            outputs[name] = values
    return IsolatedMember(member, inputs, outputs, missing)


def _source(
    port: Port,
    signal: Signal,
    connection: Connection | None,
    measured: Mapping[Port, Array],
    given: float | None,
    *,
    default: float | None,
) -> InputSource | None:
    """Return the best source of an input: measured there, upstream, given, or its default value."""
    continuous = signal.type == "real"
    if port in measured:
        return InputSource(InputOrigin.MEASURED, port, measured[port], continuous=continuous)
    if connection is not None and connection.source in measured:
        values = connection.factor * measured[connection.source] + connection.offset
        return InputSource(InputOrigin.UPSTREAM, connection.source, values, continuous=continuous)
    if given is not None:
        return InputSource(InputOrigin.SETTING, value=given)
    return None if default is None else InputSource(InputOrigin.DEFAULT, value=default)
