"""Model of a system: its members, which are FMUs, and the connections between them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kit.errors import UserError, find
from orchestration.fmu import Value

if TYPE_CHECKING:
    from fmus.kit import Component


class Port(NamedTuple):
    """A variable of a member, written as ``member.variable``."""

    member: str
    variable: str

    def __str__(self) -> str:
        return f"{self.member}.{self.variable}"


@dataclass(frozen=True)
class Member:
    """A component of a system.

    Attributes
    ----------
    name : str
        Its name in the system.
    fmu : Path
        FMU of FMI 2.0 or 3.0 for co-simulation.
    parameters : Mapping of str to float or str
        Values of parameters and of constant inputs in the FMU's units; texts for strings.
    cls : type[Component] or None
        Class of one of our components, with which the system can be fused; not needed to run it.
    """

    name: str
    fmu: Path
    parameters: Mapping[str, Value] = field(default_factory=dict)
    cls: type[Component] | None = None

    @property
    def version(self) -> tuple[Path, int]:
        """Absolute path of the FMU, and the time of its file in ns; 0 without a file."""
        path = self.fmu.absolute()
        return path, path.stat().st_mtime_ns if path.is_file() else 0

    @classmethod
    def of(
        cls,
        name: str,
        component: type[Component],
        parameters: Mapping[str, Value] | None = None,
        runtime: str = "native",
    ) -> Member:
        """Return one of our components as a member, with an FMU from the cache or newly built.

        Parameters
        ----------
        name : str
            Its name in the system.
        component : type[Component]
        parameters : Mapping of str to float or str, optional
        runtime : {"native", "python"}
            Kind of build.

        Raises
        ------
        UserError
            If there is no such runtime, or the FMU cannot be built.
        """
        from fmus.kit.build import build_cached

        return cls(name, build_cached(component, runtime), parameters or {}, component)


UNCHANGED = (1.0, 0.0, ())  # factor, offset and table


@dataclass(frozen=True)
class Connection:
    """Connection from an output to an input, which receives ``factor * source + offset``.

    The factor and the offset are SSP's LinearTransformation, the table is its mappings.

    Attributes
    ----------
    source, target : Port
        An output, and an input of another member.
    factor, offset : float
        Factor in the target's unit per the source's unit, offset in the target's unit.
    table : tuple of (float, float)
        Values of a source that is an integer or boolean, each with the value that the target
        receives in its place; it receives others unchanged.
    """

    source: Port
    target: Port
    factor: float = 1.0
    offset: float = 0.0
    table: tuple[tuple[float, float], ...] = ()

    @property
    def change(self) -> tuple[Any, ...]:
        """Factor, offset and table, `UNCHANGED` if the input receives the value as it is."""
        return self.factor, self.offset, self.table

    @property
    def passes_on(self) -> bool:
        """True if the input receives the value unchanged."""
        return self.change == UNCHANGED

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"

    @property
    def transformation(self) -> str:
        """Text of factor, offset and table, without those that change nothing."""
        factor = "" if self.factor == 1.0 else f"× {self.factor:g}"
        offset = "" if self.offset == 0.0 else f"{self.offset:+g}"
        entries = [f"{value:g} to {received:g}" for value, received in self.table]
        return " ".join(filter(None, (factor, offset, ", ".join(entries))))


@dataclass(frozen=True)
class System:
    """A system of members and connections, without checks; see `orchestration.system.checking`.

    Attributes
    ----------
    name, doc : str
    members : tuple of Member
    connections : tuple of Connection
    inputs : Mapping of str to tuple of Port
        Inputs of the system by name, with the inputs of members that they feed.
    outputs : Mapping of str to Port
        Outputs of the system by name.
    step, stop, start : float
        Communication step, stop time and start time in seconds, of the default experiment.

    Examples
    --------
    >>> import numpy, orchestration as ppy
    >>> from orchestration.system import library
    >>> bench = library.system("dma_bench")
    >>> [member.name for member in bench.members]
    ['bench', 'actuator']
    >>> ppy.run(bench, numpy.arange(0.0, 0.1, 0.001)).complete
    True
    """

    name: str
    members: tuple[Member, ...]
    connections: tuple[Connection, ...]
    inputs: Mapping[str, tuple[Port, ...]] = field(default_factory=dict)
    outputs: Mapping[str, Port] = field(default_factory=dict)
    doc: str = ""
    step: float = 1e-3
    stop: float = 1.0
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Duration of the default experiment in seconds."""
        return self.stop - self.start

    @property
    def fed_ports(self) -> list[tuple[str, Port]]:
        """Each input of the system with each port that it feeds."""
        return [(name, port) for name, ports in self.inputs.items() for port in ports]

    def member(self, name: str) -> Member:
        """Return the member of a name.

        Raises
        ------
        UserError
            If there is none.
        """
        members = {member.name: member for member in self.members}
        return find(name, members, f"system {self.name}: no member")

    def port(self, text: str) -> Port:
        """Return the port that a text ``member.variable`` names.

        Raises
        ------
        UserError
            If the text is not of this form, or there is no such member.
        """
        name = owner_of(text, [member.name for member in self.members])
        if name is not None:
            return Port(name, text[len(name) + 1 :])
        name, _, variable = text.partition(".")
        if not variable:
            raise UserError(f"system {self.name}: {text!r} is not of the form member.variable")
        return Port(self.member(name).name, variable)

    def given(self, values: Mapping[str, Value]) -> System:
        """Return the system with other values of parameters and constant inputs.

        Parameters
        ----------
        values : Mapping of str to float or str
            By ``member.variable``, in the FMU's units.

        Raises
        ------
        UserError
            If a name is not of that form, or there is no such member.
        """
        parameters = {member.name: dict(member.parameters) for member in self.members}
        for text, value in values.items():
            port = self.port(text)
            parameters[port.member][port.variable] = value
        return replace(
            self, members=tuple(replace(m, parameters=parameters[m.name]) for m in self.members)
        )

    def disconnected(self, target: str, value: float) -> System:
        """Return the system with a constant value in place of the connection to an input.

        Parameters
        ----------
        target : str
            The input ``member.variable``.
        value : float
            In the FMU's unit.

        Raises
        ------
        UserError
            If the input is not connected.
        """
        others = tuple(c for c in self.connections if c.target != self.port(target))
        if len(others) == len(self.connections):
            raise UserError(f"system {self.name}: {target} is not connected")
        return replace(self, connections=others).given({target: value})


def owner_of(text: str, members: Iterable[str]) -> str | None:
    """Return the member of a text ``member.variable``; None if it has none of these.

    A member of a system within the system has a name with a dot: the longest name that fits.
    """
    owners = [name for name in members if len(text) > len(name) + 1 and text.startswith(f"{name}.")]
    return max(owners, key=len, default=None)


def connect(*pairs: str) -> tuple[Connection, ...]:
    """Return the connections of texts ``"member.output -> member.input"``.

    Raises
    ------
    UserError
        If a text is not of this form.
    """
    return tuple(_connection(pair) for pair in pairs)


def _connection(text: str) -> Connection:
    """Return the connection of one text of `connect`."""
    parts = [end.strip().partition(".") for end in text.split("->")]
    if len(parts) != 2 or not all(member and variable for member, _, variable in parts):
        raise UserError(f"{text!r} is not of the form member.output -> member.input")
    source, target = (Port(member, variable) for member, _, variable in parts)
    return Connection(source=source, target=target)
