"""Parts of ``modelDescription.xml`` that FMI 2.0 and 3.0 have in common."""

from __future__ import annotations

import datetime
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from fmus.kit import units
from fmus.kit.build.parameters import written
from fmus.kit.component import Component
from fmus.kit.declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    StateDeclaration,
    TextDeclaration,
    summary,
)
from fmus.kit.errors import UserError
from fmus.kit.layout import Layout
from fmus.kit.units import to_modelica

# names of quantities for TypeDefinitions, by declared unit
_QUANTITIES = {
    "A": "ElectricCurrent",
    "V": "ElectricPotential",
    "C": "ElectricCharge",
    "ohm": "Resistance",
    "F": "Capacitance",
    "m": "Displacement",
    "N": "Force",
    "N/m": "Stiffness",
    "N*s/m": "Damping",
    "m/C": "DisplacementPerCharge",
    "s": "Time",
    "1": "Ratio",
    "Hz": "Frequency",
    "rad": "Angle",
    "m/s": "Velocity",
    "N*m": "Torque",
    "K": "Temperature",
}

_OURS = {
    "author": "the ppy-rig project",
    "copyright": "Copyright (c) 2026, the ppy-rig authors",
    "license": "BSD-3-Clause",
}

_RELEASED = "2026-11-20T00:00:00Z"  # of this version, as in CHANGELOG.md
_VARIABLE = "SOURCE_DATE_EPOCH"
_LATEST = 253402300799  # s, the end of the year 9999

CATEGORIES = {
    "logStatusWarning": "something questionable was accepted",
    "logStatusDiscard": "a request was declined",
    "logStatusError": "a request failed; the message says why",
    "logStatusFatal": "the instance is unusable",
}


@dataclass(frozen=True)
class Capabilities:
    """The capabilities of a build, for the elements ``CoSimulation`` and ``ModelExchange``.

    Attributes
    ----------
    needs_execution_tool : bool
        Whether a Python interpreter must be there at run time.
    interpolates_inputs : bool
        Whether a host may set the time derivatives of inputs.
    directional_derivatives : bool
        Whether the FMU computes directional derivatives.
    model_exchange : bool
        Whether a host may integrate the states.
    sources : tuple of str
        Source files listed for recompilation.
    clocks : bool
        Whether output clocks are declared, in FMI 3.0.
    varies_step : bool
        Whether communication steps may differ in size.
    runs_once : bool
        Whether a process can have one instance only.
    """

    needs_execution_tool: bool
    interpolates_inputs: bool
    directional_derivatives: bool
    model_exchange: bool = False
    sources: tuple[str, ...] = ()
    clocks: bool = False
    varies_step: bool = True
    runs_once: bool = False


def generation_date() -> str:
    """Return the date and time for ``generationDateAndTime``.

    It is not the time of the clock, so that the same sources give the same bytes.

    Returns
    -------
    str
        In UTC: ``SOURCE_DATE_EPOCH`` of the environment (seconds since 1970), or by default the
        date of this version.

    Raises
    ------
    UserError
        If ``SOURCE_DATE_EPOCH`` is not a whole number of seconds, at most that of the year 9999.
    """
    seconds = os.environ.get(_VARIABLE, "")
    if not seconds:
        return _RELEASED
    if not (seconds.isascii() and seconds.isdigit() and int(seconds[:20]) <= _LATEST):
        raise UserError(
            f"{_VARIABLE} = {seconds[:40]!r}: seconds since 1970 are wanted, a whole number from 0"
            f" to {_LATEST}"
        )
    return datetime.datetime.fromtimestamp(int(seconds), datetime.UTC).strftime(
        "%Y-%m-%dT%H:%M:%SZ"
    )


def origin(cls: type[Component]) -> dict[str, str]:
    """Return author, copyright and licence of a component.

    The defaults are those of this project, for a class all of whose bases belong to it.
    """
    package = __package__.partition(".")[0]
    ours = all(
        part.__module__.partition(".")[0] == package for part in cls.__mro__ if part is not object
    )
    declared = {"author": cls.author, "copyright": cls.copyright, "license": cls.license}
    return {name: text or _OURS[name] for name, text in declared.items() if text or ours}


def flag(value: bool) -> str:
    """Write a boolean as XML does.

    Parameters
    ----------
    value : bool

    Returns
    -------
    str
    """
    return "true" if value else "false"


def number(value: float) -> str:
    """Write a number with as few digits as read back to the same number.

    Parameters
    ----------
    value : float

    Returns
    -------
    str
    """
    return repr(float(value)).removesuffix(".0")


def typed_reals(layout: Layout) -> dict[str, Declaration]:
    """Return the first real variable of each type.

    Variables of the same quantity and display unit share a type.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    dict of str to Declaration
        Variable by name of the type, sorted.
    """
    reals = [variable for variable in layout.variables if variable.type == "real"]
    first = {type_name(variable): variable for variable in reversed(reals)}  # the last one wins
    return {name: first[name] for name in sorted(first)}


def define_units(root: Element, layout: Layout, others: Iterable[str] = ()) -> None:
    """Append the units and the display units of real variables.

    Parameters
    ----------
    root : Element
    layout : Layout
    others : iterable of str
        Further units.
    """
    of_derivatives = [unit for _, unit in layout.derivatives]
    displays: dict[str, set[str]] = {unit: set() for unit in (*of_derivatives, *others)}
    for variable in layout.variables:
        if variable.type == "real":
            display_units = displays.setdefault(variable.unit, set())
            if variable.display:
                display_units.add(variable.display)
    definitions = SubElement(root, "UnitDefinitions")
    defined: dict[str, Element] = {}
    # units that are spelt alike in Modelica, such as m/s/s and m/s^2, are defined once
    for unit in sorted(displays, key=to_modelica):
        name = to_modelica(unit)
        if name not in defined:
            defined[name] = _define_base_unit(SubElement(definitions, "Unit", name=name), unit)
        for display in sorted(displays[unit]):
            _define_display_unit(defined[name], unit, display)


def _define_base_unit(node: Element, unit: str) -> Element:
    """Append the definition of a unit in SI base units to its node; return the node."""
    base = units.base_unit(unit)
    attributes = {name: str(power) for name, power in sorted(base.exponents.items())}
    if base.factor != 1.0:
        attributes["factor"] = number(base.factor)
    if base.offset:
        attributes["offset"] = number(base.offset)
    SubElement(node, "BaseUnit", attributes)
    return node


def _define_display_unit(node: Element, unit: str, display: str) -> None:
    """Append the definition of a display unit, unless the node already has it."""
    name = to_modelica(display)
    if node.find(f"DisplayUnit[@name='{name}']") is not None:
        return
    # FMI: display value = factor * value + offset
    offset = units.convert(0.0, unit, display)
    factor = units.convert(1.0, unit, display) - offset
    SubElement(node, "DisplayUnit", name=name, factor=number(factor), offset=number(offset))


def quantity(unit: str) -> str:
    """Return the name of the quantity of a unit.

    Parameters
    ----------
    unit : str
        Unit as declared.

    Returns
    -------
    str
        The unit in Modelica's spelling if the quantity has no name here.
    """
    return _QUANTITIES.get(unit, to_modelica(unit))


def type_name(variable: Declaration) -> str:
    """Return the name of the type of a real variable, from its quantity and display unit.

    Parameters
    ----------
    variable : Declaration

    Returns
    -------
    str
    """
    name = quantity(variable.unit)
    if variable.display:
        name += f"_in_{to_modelica(variable.display)}"
    return name.replace(" ", "_")


def unit_attributes(variable: Declaration) -> dict[str, str]:
    """Return the attributes for the unit and the display unit of a variable.

    Parameters
    ----------
    variable : Declaration

    Returns
    -------
    dict of str to str
    """
    attributes = {"unit": to_modelica(variable.unit)}
    if variable.display:
        attributes["displayUnit"] = to_modelica(variable.display)
    return attributes


_KINDS = {
    ParameterDeclaration: {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    InputDeclaration: {"causality": "input", "variability": "continuous"},
    OutputDeclaration: {
        "causality": "output",
        "variability": "continuous",
        "initial": "calculated",
    },
    StateDeclaration: {"causality": "local", "variability": "continuous", "initial": "calculated"},
    DiscreteDeclaration: {"causality": "local", "variability": "discrete", "initial": "calculated"},
}


def _value(value: float, kind: str) -> str:
    """Write a value of type real, integer or boolean."""
    return number(value) if kind == "real" else written(value, kind)


def variable_attributes(reference: int, variable: Declaration) -> dict[str, str]:
    """Return the attributes for name, description, causality, variability and ``initial``.

    Parameters
    ----------
    reference : int
        Its value reference.
    variable : Declaration

    Returns
    -------
    dict of str to str
    """
    kind = dict(_KINDS[type(variable)])
    if getattr(variable, "output", False):
        kind["causality"] = "output"
    if getattr(variable, "tunable", False):
        kind["variability"] = "tunable"
    elif variable.type != "real" and kind["variability"] == "continuous":
        kind["variability"] = "discrete"
    description = variable.doc + (f" [{variable.source}]" if variable.source else "")
    return _identity(variable.name, reference, description) | kind


def _identity(name: str, reference: int, description: str) -> dict[str, str]:
    """Return the attributes for name, value reference and description of a variable."""
    return {"name": name, "valueReference": str(reference), "description": description}


def value_attributes(variable: Declaration) -> dict[str, str]:
    """Return the attributes for type, unit, bounds, nominal and start value of a variable.

    Parameters
    ----------
    variable : Declaration

    Returns
    -------
    dict of str to str
    """
    attributes = {}
    if variable.type == "real":
        attributes = {"declaredType": type_name(variable)} | unit_attributes(variable)
    if variable.type != "boolean":
        bounds = {"min": variable.min, "max": variable.max}
        finite = {name: bound for name, bound in bounds.items() if math.isfinite(bound)}
        attributes |= {name: _value(bound, variable.type) for name, bound in finite.items()}
    if variable.type == "real" and variable.nominal != 1.0:
        attributes["nominal"] = number(variable.nominal)
    if isinstance(variable, (ParameterDeclaration, InputDeclaration)):
        attributes["start"] = _value(variable.start, variable.type)
    return attributes


def calculated(name: str, reference: int, description: str) -> dict[str, str]:
    """Return the attributes of a calculated local variable, such as a derivative.

    Parameters
    ----------
    name : str
    reference : int
        Its value reference.
    description : str

    Returns
    -------
    dict of str to str
    """
    return _identity(name, reference, description) | _KINDS[StateDeclaration]


def derivatives(layout: Layout) -> Iterator[tuple[dict[str, str], str, int]]:
    """Yield for each derivative its attributes, its unit and the reference of its state.

    Parameters
    ----------
    layout : Layout

    Yields
    ------
    attributes : dict of str to str
    unit : str
        In Modelica's spelling.
    state : int
        Value reference of the state.
    """
    first_state = len(layout.parameters) + len(layout.inputs)
    first = len(layout.variables)
    for index, (name, unit) in enumerate(layout.derivatives):
        description = f"time derivative of {layout.states[index].name}"
        yield calculated(name, first + index, description), to_modelica(unit), first_state + index


def text_attributes(reference: int, parameter: TextDeclaration) -> dict[str, str]:
    """Return the attributes of a text parameter without its start value.

    Parameters
    ----------
    reference : int
        Its value reference.
    parameter : TextDeclaration

    Returns
    -------
    dict of str to str
    """
    return _identity(parameter.name, reference, parameter.doc) | _KINDS[ParameterDeclaration]


def model_description(cls: type[Component], version: str, identity: dict[str, str]) -> Element:
    """Make the root of a model description.

    Parameters
    ----------
    cls : type[Component]
    version : str
        Version of this package.
    identity : dict of str to str
        Attributes for the version of FMI and for the GUID or instantiation token.

    Returns
    -------
    Element
    """
    text = ". ".join([summary(cls), *cls.remark.splitlines()])
    common = {
        "modelName": cls.name,
        "description": text,
        "version": version,
        "generationTool": f"ppy-rig {version}",
        "generationDateAndTime": generation_date(),
        "variableNamingConvention": "structured",
    }
    return Element("fmiModelDescription", identity | common | origin(cls))


def append_experiment(root: Element, cls: type[Component]) -> None:
    """Append the log categories and the default experiment.

    Parameters
    ----------
    root : Element
    cls : type[Component]
    """
    categories = SubElement(root, "LogCategories")
    for name, meaning in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=meaning)
    stop, step = cls.experiment
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=number(stop),
        stepSize=number(step),
        tolerance=number(cls.tolerance),
    )


def type_attributes(variable: Declaration) -> dict[str, str]:
    """Return the attributes of the type of a real variable.

    Parameters
    ----------
    variable : Declaration

    Returns
    -------
    dict of str to str
    """
    return {"quantity": quantity(variable.unit)} | unit_attributes(variable)
