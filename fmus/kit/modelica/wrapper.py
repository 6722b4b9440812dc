"""A Modelica model that loads the FMU of a component and steps it, in co-simulation.

The FMU is an external object (specification 3.6, section 12.9.7), which ``include/ppy_rig_fmu.h``
loads and steps. At every communication point the FMU steps from the previous point to this one,
with the inputs of the previous point; its outputs are constant until the next point. Inputs are
sampled from before the instant, so that the FMU is in no algebraic loop.
"""

from __future__ import annotations

from fmus.kit.component import Component
from fmus.kit.declare import Declaration, summary
from fmus.kit.modelica.annotations import annotation
from fmus.kit.modelica.connectors import port_equations
from fmus.kit.modelica.declarations import declarations, declared_identifiers
from fmus.kit.modelica.names import (
    class_name,
    comment,
    identifier,
    indented,
    real,
    string,
    wrapped,
)

WRAPPERS = "FMUs"  # name of their package
_INCLUDE = (
    'annotation(Include="#include \\"ppy_rig_fmu.h\\"",'
    ' IncludeDirectory="modelica://PpyRig/Resources/Include")'
)
_INSTANCE = f"""\
class Instance "An FMU that is loaded"
  extends ExternalObject;
  function constructor "Loads an FMU"
    input String name "of the FMU, and of its library";
    input String guid;
    input String types "of its variables, a letter each: r, i or b";
    input Integer inputs "place of the first input among them";
    input Real parameters[:] "values of the first of them";
    output Instance instance;
    external "C" instance = ppy_rig_open(name, guid, types, inputs, parameters, size(parameters, 1))
      {_INCLUDE};
  end constructor;
  function destructor "Ends an FMU"
    input Instance instance;
    external "C" ppy_rig_close(instance)
      {_INCLUDE};
  end destructor;
end Instance;
"""
_COMMUNICATE = f"""\
impure function communicate "Outputs of an FMU at a communication point"
  input Instance instance;
  input Real now "time of the point";
  input Real inputs[:];
  input Integer outputs[:] "places among its variables";
  output Real values[size(outputs, 1)];
  external "C" ppy_rig_communicate(instance, now, inputs, size(inputs, 1), outputs,
    size(outputs, 1), values)
    {_INCLUDE};
end communicate;
"""


def support_classes() -> dict[str, str]:
    """Write the classes that every wrapper uses.

    Returns
    -------
    dict of str to str
        Text of each class by its name, without the ``within`` clause.
    """
    return {"Instance": _INSTANCE, "communicate": _COMMUNICATE}


def wrapper_text(cls: type[Component], guid: str) -> str:
    """Write the model that loads the FMU of a component.

    Parameters
    ----------
    cls : type[Component]
    guid : str
        GUID of the FMU.

    Returns
    -------
    str
        Text of the class, without the ``within`` clause.
    """
    layout = cls.layout
    name = class_name(cls.name)
    taken = declared_identifiers(cls)
    step = identifier("communication_step", taken)
    fmu = identifier("fmu", taken)
    values = identifier("results", taken)
    places = {v.name: k for k, v in enumerate(layout.variables)}
    inputs = _array([_as_real(v, before=True) for v in layout.inputs])
    outputs = _array([str(places[v.name]) for v in layout.shown])
    about = f"{summary(cls)}, computed by its FMU"
    lines = [
        f"{'model' if cls.ports else 'block'} {name}{comment(about)}",
        *indented(declarations(cls, states=False)),
        f'  parameter Real {step}(unit="s", min=1e-09) = {real(cls.experiment[1])}'
        ' "time between communication points";',
        "protected",
        *_instance_declaration(cls, guid, fmu),
        f"  Real {values}[{len(layout.shown)}];",
        "equation",
    ]
    for port in cls.ports:
        lines += wrapped(port_equations(port))
    lines += [
        f"  when {{initial(), sample({step}, {step})}} then",
        *wrapped([f"{values} = communicate({fmu}, time, {inputs}, {outputs});"], "    "),
        "  end when;",
        *wrapped(
            f"{identifier(v.name)} = {_from_real(f'{values}[{k}]', v.type)};"
            for k, v in enumerate(layout.shown, 1)
        ),
        f"  {annotation(cls)}",
        f"end {name};",
    ]
    return "\n".join(lines) + "\n"


def _instance_declaration(cls: type[Component], guid: str, name: str) -> list[str]:
    """Write the declaration of the FMU's instance: types of variables, values of parameters."""
    layout = cls.layout
    types = "".join(v.type[0] for v in layout.variables)
    arguments = f"{string(cls.name)}, {string(guid)}, {string(types)}, {len(layout.parameters)}"
    parameters = _array([_as_real(p) for p in layout.parameters])
    return [f"  Instance {name} = Instance({arguments},", *wrapped([f"{parameters});"], "    ")]


def _array(elements: list[str]) -> str:
    """Write an array; an empty one as ``fill``, because ``{}`` has no type."""
    return f"{{{', '.join(elements)}}}" if elements else "fill(0, 0)"


def _as_real(v: Declaration, before: bool = False) -> str:
    """Write the value of a variable, now or before an instant, converted to a Real."""
    name = identifier(v.name)
    text = f"pre({name})" if before else name
    return f"if {text} then 1.0 else 0.0" if v.type == "boolean" else text


def _from_real(value: str, type: str) -> str:
    """Write the conversion of a Real to a type."""
    if type == "boolean":
        return f"{value} > 0.5"
    return f"integer({value} + 0.5)" if type == "integer" else value
