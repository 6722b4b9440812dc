"""Model of an experiment's file: its tables and keys, with checks that need no subject."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    PlainValidator,
    model_validator,
)

from orchestration.experiment.stimulus import AnyStimulus
from orchestration.experiment.values import Amount, File, Span, ValueTable, checked


def _check_setting(given: Any) -> Any:
    """Return the value of a parameter; raise ValueError for a list, a table or a date."""
    if not isinstance(given, bool | int | float | str):
        raise ValueError("a number, a text with a number and a unit, true or false is needed")
    return given


def _flatten(given: Any) -> Any:
    """Flatten the tables of TOML: ``actuator.R1 = 1`` sets the parameter ``actuator.R1``."""
    if not isinstance(given, dict):
        return given
    flat: dict[str, Any] = {}
    for name, value in given.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{n}": v for n, v in _flatten(value).items()}
        else:
            flat[name] = value
    return flat


Setting = Annotated[bool | int | float | str, PlainValidator(_check_setting)]
Settings = Annotated[dict[str, Setting], BeforeValidator(_flatten)]


class NoiseTable(ValueTable):
    """Noise that a measurement adds to a recorded output.

    It is white, or AR(1) with `correlation` from one point to the next.
    """

    rms: Amount
    correlation: Annotated[float, Field(gt=-1.0, lt=1.0)] = 0.0


class Master(ValueTable):
    """Options of running a system, by the master or fused into one model.

    The keywords are those of :func:`orchestration.master.run`.
    """

    method: Literal["gauss-seidel", "jacobi", "fused"] = "gauss-seidel"
    extrapolation: Annotated[int, Field(ge=0, le=1, strict=True)] = 0
    feedthrough: bool = True
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    rates: dict[str, Annotated[float, Field(gt=0.0)]] | None = None

    @model_validator(mode="after")
    def _check_fused_options(self) -> Master:
        """Raise ValueError if a fused system has options of the exchange between members."""
        options = self._changed_options()
        if self.method == "fused" and options:
            raise ValueError(
                f"{options[0]} is about exchange between members; a fused system has none"
            )
        return self

    def _changed_options(self) -> list[str]:
        """List the keys, except the method, that are not at their default."""
        return [
            key
            for key, field in Master.model_fields.items()
            if key != "method" and getattr(self, key) != field.default
        ]

    @property
    def couples_evenly(self) -> bool:
        """True if members exchange values at communication points only."""
        return self.method != "fused" and not set(self._changed_options()) - {"extrapolation"}


UNITS_OF_LOOP = {
    "force": "N",
    "reference": "m",
    "length": "m",
    "current": "A",
    "voltage": "V",
    "charge_length": "m",
    "charge": "C",
}
"""Units of the signals of a work loop, by the key of its tables."""


class CouplingTable(ValueTable):
    """Length that the charge makes, and the parameters by which the load acts on the voltage.

    Per load it is `reaction`, less `alpha` where `reciprocal`.
    """

    charge_length: str
    charge: str
    reaction: str
    reciprocal: str
    alpha: str

    @property
    def parameters(self) -> dict[str, str]:
        """Names of the parameters, by their key."""
        return {key: getattr(self, key) for key in ("reaction", "reciprocal", "alpha")}


class WorkLoopTable(ValueTable):
    """Period and signals of a work loop, with which its cycles are drawn and measured."""

    period: Span
    force: str
    reference: str
    length: str
    current: str
    voltage: str
    coupling: CouplingTable | None = None

    @property
    def signals(self) -> dict[str, str]:
        """Names of the signals, by their key."""
        tables = (self, self.coupling)
        return {
            key: getattr(table, key)
            for table in tables
            for key in UNITS_OF_LOOP
            if hasattr(table, key)
        }


class Experiment(ValueTable):
    """An experiment on a component or a system; ``docs/reference/experiments.md`` has every key."""

    title: str = ""
    source: str = ""
    component: File | None = None
    system: File | None = None
    runtime: Literal["native", "python"] = "native"
    preset: str | None = None
    effects: list[str] = []
    duration: Span | None = None
    step: Span | None = None
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    master: Master | None = None
    parameters: Settings = {}
    inputs: dict[str, AnyStimulus] = {}
    record: list[str] | None = None
    noise: dict[str, NoiseTable] = {}
    over: str = "time"
    variants: dict[str, Settings] = {}
    work_loop: WorkLoopTable | None = None

    @property
    def chosen_runtime(self) -> str | None:
        """The kind of build that the file names; None if it names none, as FMUs are then kept."""
        return self.runtime if "runtime" in self.model_fields_set else None

    @model_validator(mode="after")
    def _check_subject(self) -> Experiment:
        """Raise ValueError for no or two subjects, and for keys of the other kind of subject."""
        if (self.component is None) == (self.system is None):
            raise ValueError("name a component or a system, one of them")
        keys_of = {"component": ("preset", "effects"), "system": ("master",)}
        kind, other = ("component", "system") if self.component else ("system", "component")
        for key in keys_of[other]:
            if getattr(self, key):
                raise ValueError(f"{key} is for a {other}, this experiment is on a {kind}")
        if self.master and self.master.method == "fused" and self.runtime != "native":
            raise ValueError(
                f"runtime = {self.runtime!r}: a fused system is compiled, no build of its FMUs"
                " is run"
            )
        return self

    @model_validator(mode="after")
    def _check_variants(self) -> Experiment:
        """Raise ValueError for a variant without a name, and variants over a recorded output."""
        if "" in self.variants:
            raise ValueError("variants: every variant needs a name")
        driven = ["time", *self.inputs]
        if self.variants and self.over not in driven:
            raise ValueError(
                f"over = {self.over!r}: with variants allowed are {', '.join(driven)}, which all"
                " have in common"
            )
        return self

    @model_validator(mode="after")
    def _check_duration_of_loop(self) -> Experiment:
        """Raise ValueError if the experiment is shorter than a cycle of its work loop."""
        loop = self.work_loop
        if loop and self.duration and self.duration < loop.period:
            raise ValueError(
                f"duration = {self.duration:g} s: a work loop needs a period of"
                f" {loop.period:g} s or more"
            )
        return self


def parse(given: Mapping[str, Any], where: str, folder: str | None = None) -> Experiment:
    """Check the tables of an experiment's file.

    Parameters
    ----------
    given : Mapping
        Tables and keys.
    where : str
        Name of the file, for messages.
    folder : str, optional
        Folder of relative paths.

    Raises
    ------
    UserError
        For the first error, with the file, the key, the value and the allowed values.
    """
    return checked(Experiment, given, where, folder)
