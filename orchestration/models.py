"""What a user may name where a model is wanted: one of our components, or any FMU file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import units
from fmus.kit.documentation import allowed, shown
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu_file import read_description
from orchestration.signals import Signal, check_type, read_signal

if TYPE_CHECKING:
    from fmus.kit import Component

_SETTING = re.compile(r"^\s*(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>.*)$")
_WORDS = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class Model:
    """An FMU to run, and the class behind it if it is ours.

    Attributes
    ----------
    name : str
    path : Path
        The FMU file.
    cls : type[Component] or None
    inputs, outputs, parameters : dict of str to Signal
    """

    name: str
    path: Path
    cls: type[Component] | None
    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    parameters: Mapping[str, Signal]

    def settings(self, texts: Sequence[str], preset: str | None = None) -> dict[str, float]:
        """Read ``name=value[unit]`` settings, after those of a preset.

        Parameters
        ----------
        texts : sequence of str
            Each like ``R1=0.61``, ``R1=610mohm`` or ``k1=6.3[N/mm]``.
        preset : str, optional
            Name of one of the component's presets.

        Returns
        -------
        dict of str to float
            Values in the FMU's units.

        Raises
        ------
        UserError
            For an unknown parameter or preset, a wrong unit, a value out of range.
        """
        values: dict[str, float] = {}
        if preset is not None:
            presets = self.cls.presets if self.cls else {}
            if preset not in presets:
                raise UserError(f"{self.name}: no preset named {preset!r}; there are: {', '.join(presets) or 'none'}")
            values |= dict(presets[preset].values)
        for text in texts:
            name, equals, given = text.partition("=")
            if not equals:
                raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
            values[name.strip()] = self._setting(name.strip(), given)
        return values

    def _setting(self, name: str, given: str) -> float:
        where = f"--set {name}={given}"
        signal = self.parameters.get(name) or self.inputs.get(name)
        if signal is None:
            raise UserError(
                f"{self.name}: no parameter named {name!r}{suggestion(name, [*self.parameters, *self.inputs])}"
            )
        if signal.type == "boolean" and given.strip() in _WORDS:
            return _WORDS[given.strip()]
        match = _SETTING.match(given)
        if not match:
            words = " (nor true or false)" if signal.type == "boolean" else ""
            raise UserError(f"{where}: {given!r} is not a number with an optional unit{words}")
        value = float(match["number"])
        unit = match["unit"].strip().removeprefix("[").removesuffix("]").strip()
        if unit:
            try:
                value = float(units.convert(value, unit, signal.unit, where))
            except UserError as error:
                raise UserError(str(error) if where in str(error) else f"{where}: {error}") from error
        check_type(signal.type, value, where)
        if not signal.min <= value <= signal.max:
            raise UserError(f"{where}: {shown(value, signal)} is out of range; allowed is {allowed(signal)}")
        return value


def find_model(name_or_path: str, runtime: str = "native") -> Model:
    """Find a model by component name or FMU path; a component is built if it is not in the cache.

    Parameters
    ----------
    name_or_path : str
    runtime : {"native", "python"}
        Which build of a component.

    Raises
    ------
    UserError
        If there is no such component or file, or the FMU cannot be read.
    """
    from fmus import COMPONENTS, component

    cls = None
    if name_or_path in COMPONENTS:
        from fmus.kit.build import build_cached

        cls = component(name_or_path)
        path = build_cached(cls, runtime)
    else:
        path = Path(name_or_path)
        if not path.exists() and path.suffix != ".fmu":
            component(name_or_path)  # raises, naming the components there are
    groups: dict[str, dict[str, Signal]] = {"input": {}, "output": {}, "parameter": {}}
    for v in read_description(path).modelVariables:
        if v.causality in groups and v.type != "String":
            groups[v.causality][v.name] = read_signal(v)
    return Model(name_or_path if cls else path.name, path, cls, groups["input"], groups["output"], groups["parameter"])
