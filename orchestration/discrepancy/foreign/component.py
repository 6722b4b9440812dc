"""The component that stands behind an FMU: it hands its outputs on, and every one of them is a law to be asked.

What the FMU simulates reaches it as an input, so that effects of measurement, and curves over any signal of the FMU,
are laid over it as over any component of ours. What a small change of a parameter of the FMU does to an output is an
input too, by the size of which that parameter may change (a linearisation): no correction takes over what a parameter
can do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

from fmus.kit import Component, files
from fmus.kit import units as known_units
from fmus.kit.build import toolchain
from fmus.kit.errors import UserError
from orchestration.fmu.loading import load_class
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal
from orchestration.identify.black_box.study.component import class_name, identifiers

SIMULATED, CHANGE = "simulated_{}", "change_of_{}"
_HEAD = '''"""What stands behind {name}: its outputs, as they are."""

from fmus.kit import Component, Input, Output, Parameter


class {cls}(Component):
    """Outputs of {name}, as they are."""

    name = "{identifier}"
    experiment = ({stop!r}, {step!r})
'''


@dataclass(frozen=True)
class Behind:
    """The component behind an FMU.

    Attributes
    ----------
    cls : type[Component]
    names : dict of str to str
        Of its inputs and outputs by those of the FMU.
    fitted : dict of str to str
        Of its parameters by those of the FMU that may change.
    """

    cls: type[Component]
    names: dict[str, str]
    fitted: dict[str, str]

    def simulated(self, output: str) -> str:
        """Name of the input that has what the FMU simulates."""
        return SIMULATED.format(self.names[output])

    def slope(self, output: str, parameter: str) -> str:
        """Name of the input that has what a parameter, changed by its size, does to an output."""
        return f"{self.names[output]}_by_{self.fitted[parameter]}"


def behind(model: Model, measured: Sequence[str], fit: Sequence[str], stop: float, step: float) -> Behind:
    """Write and load the component behind an FMU.

    Parameters
    ----------
    model : Model
    measured : sequence of str
        Outputs that are judged; the other ones are signals only.
    fit : sequence of str
        Parameters of the FMU that may change.
    stop, step : float
        Of its experiment, s.
    """
    inputs = {n: s for n, s in model.inputs.items() if s.type == "real"}
    outputs = {n: s for n, s in model.outputs.items() if s.type == "real"}
    names = dict(zip((*inputs, *outputs), identifiers((*inputs, *outputs)), strict=True))
    fitted = {p: CHANGE.format(name) for p, name in zip(fit, identifiers(tuple(fit)), strict=True)}
    found = Behind(Component, names, fitted)
    lines = [f'    {names[n]} = Input("{_unit(s)}", doc="{_doc(s)}")' for n, s in inputs.items()]
    lines += [f'    {found.simulated(n)} = Input("{_unit(s)}", doc="{n} of the FMU")' for n, s in outputs.items()]
    for p, name in fitted.items():
        lines.append(f'    {name} = Parameter(0.0, "1", nominal=0.1, doc="of {p}, relative to its size")')
        lines += [
            f'    {found.slope(n, p)} = Input("{_unit(outputs[n])}", doc="what {p} does to {n}")' for n in measured
        ]
    for n in measured:
        terms = [f"self.{found.simulated(n)}"] + [f"self.{c} * self.{found.slope(n, p)}" for p, c in fitted.items()]
        lines += ["", f'    @Output("{_unit(outputs[n])}")', f"    def {names[n]}(self):"]
        lines.append(f'        """{_doc(outputs[n])}."""')
        lines.append(f"        return {' + '.join(terms)}")
    (identifier,) = identifiers((model.path.stem,))
    head = _HEAD.format(
        name=model.path.name, cls=class_name(identifier), identifier=f"{identifier}_corrected", stop=stop, step=step
    )
    text = head + "\n".join(["", *lines, ""])
    folder = toolchain.cache_folder() / f"behind-{sha256(text.encode()).hexdigest()[:16]}"
    file = folder / f"{identifier}.py"
    files.write(file, text.encode())
    return replace(found, cls=load_class(f"{file}:{class_name(identifier)}"))


def _unit(signal: Signal) -> str:
    """A unit that the kit knows, or none."""
    try:
        known_units.parse(signal.unit)
    except UserError:
        return "1"
    return signal.unit


def _doc(signal: Signal) -> str:
    return "".join(c for c in signal.doc if c.isprintable() and c not in '"\\').strip(". ") or signal.name
