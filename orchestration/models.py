"""What a user may name where a model is wanted: one of our components, or any FMU file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit.errors import UserError, suggestion
from orchestration.fmu_file import read_description
from orchestration.signals import Signal, read_setting, read_signal

if TYPE_CHECKING:
    from fmus.kit import Component


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
        signal = self.parameters.get(name) or self.inputs.get(name)
        if signal is None:
            raise UserError(
                f"{self.name}: no parameter named {name!r}{suggestion(name, [*self.parameters, *self.inputs])}"
            )
        return read_setting(given, signal, f"--set {name}={given}")


def find_model(name_or_path: str, runtime: str = "native", laid_over: Sequence[str] = ()) -> Model:
    """Find a model by component name or FMU path; a component is built if it is not in the cache.

    Parameters
    ----------
    name_or_path : str
    runtime : {"native", "python"}
        Which build of a component.
    laid_over : sequence of str
        Ids of effects over a component, innermost first.

    Raises
    ------
    UserError
        If there is no such component, effect or file, or the FMU cannot be read.
    """
    from fmus import COMPONENTS, component, effects

    cls = None
    if name_or_path in COMPONENTS:
        from fmus.kit import stack
        from fmus.kit.build import build_cached

        cls = component(name_or_path)
        known = effects(name_or_path) if laid_over else {}
        for effect in laid_over:
            if effect not in known:
                raise UserError(f"{name_or_path}: no effect named {effect!r}{suggestion(effect, known)}")
        cls = stack(cls, *(known[effect] for effect in laid_over)) if laid_over else cls
        path = build_cached(cls, runtime)
    elif laid_over:
        raise UserError(f"{name_or_path}: effects can be laid over a component of ours only (see ppy list)")
    else:
        path = Path(name_or_path)
        if not path.exists() and path.suffix != ".fmu":
            component(name_or_path)  # raises, naming the components there are
    groups: dict[str, dict[str, Signal]] = {"input": {}, "output": {}, "parameter": {}}
    for v in read_description(path).modelVariables:
        if v.causality in groups and v.type != "String":
            groups[v.causality][v.name] = read_signal(v)
    return Model(name_or_path if cls else path.name, path, cls, groups["input"], groups["output"], groups["parameter"])
