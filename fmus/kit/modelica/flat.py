"""Components as flat classes for pymoca 0.12, which gives their equations to CasADi.

It loses connectors that are one number, has no ``sample``, ``pre`` and ``noEvent``, and divides by
a method that CasADi 3.8 lacks. Here a class has no connectors: inputs are inputs. What is sampled
is an input, held between samples, and an output ``next_NAME`` that is its value after a sample of
its clock. Clocks that coincide are sampled in the order of their declaration.
"""

from __future__ import annotations

import re

import casadi as ca

from fmus.kit.declare import Declaration, summary
from fmus.kit.layout import Layout
from fmus.kit.modelica.declarations import declaration, declared_identifiers, literal
from fmus.kit.modelica.equations import Target, define
from fmus.kit.modelica.expressions import ExpressionNode, apply, constant
from fmus.kit.modelica.model import TracedModel
from fmus.kit.modelica.names import class_name, comment, identifier, indented, wrapped

Names = dict[ExpressionNode, str]
# functions of the package, by those of CasADi, which have no events either
_BUILT_IN = {"roundedDown": "floor", "roundedUp": "ceil", "hypotenuse": "hypot"}
_FUNCTION = re.compile(r"Functions\.(\w+)")


def flat_text(model: TracedModel) -> str:
    """Write a component as a model without connectors, events and samples.

    Parameters
    ----------
    model : TracedModel

    Returns
    -------
    str
        Text of the class, without the ``within`` clause.
    """
    targets, *names = _targets(model)
    taken = declared_identifiers(model.cls) | {target.text for target in targets}
    equations = define(targets, *names, taken)
    name = class_name(model.cls.name)
    lines = [
        f"model {name}{comment(summary(model.cls))}",
        *indented(_declarations(model.layout)),
        "protected",
        *indented(map(model.auxiliary, equations.auxiliaries)),
        "equation",
        *wrapped(_FUNCTION.sub(lambda match: _BUILT_IN[match[1]], x) for x in equations.lines),
        f"end {name};",
    ]
    return "\n".join(lines) + "\n"


def _targets(model: TracedModel) -> tuple[list[Target], Names, Names]:
    """Return what is defined, and the names of the expressions of laws and intermediates."""
    layout = model.layout
    graph = model.graph
    texts = {v.name: identifier(v.name) for v in layout.variables}
    results = [graph.rates, graph.outputs, *graph.updates]
    nodes = model.expression_nodes(texts, results, _without_division)
    rates, outputs, *updates, laws, intermediates = nodes
    clocks = {d.name: k for k, (_, members) in enumerate(layout.sampled) for d in members}
    sampled = [updates[clocks[d.name]][place] for place, d in enumerate(layout.discretes)]
    left = [f"der({texts[s.name]})" for s in layout.states]
    left += [texts[o.name] for o in layout.outputs]
    left += map(_next, layout.discretes)
    types = map(_type_of, (*layout.states, *layout.outputs, *layout.discretes))
    right = [*rates, *outputs, *sampled]
    targets = [Target(*parts) for parts in zip(left, types, right, strict=True)]
    return targets, *model.names_of(laws, intermediates)


def _declarations(layout: Layout) -> list[str]:
    """Write the declarations of parameters, inputs, states and outputs."""
    lines = [
        declaration(f"parameter {p.type.capitalize()}", p, {}, literal(p.start, p.type))
        for p in layout.parameters
    ]
    shown = [s for s in layout.states if s.output]
    hidden = [s for s in layout.states if not s.output]
    groups = {"input ": (*layout.inputs, *layout.discretes), "": hidden}
    for causality, variables in (groups | {"output ": (*shown, *layout.outputs)}).items():
        for v in variables:
            start = layout.start_of.get(v.name)
            attributes = {"start": identifier(start)} if start else {}
            lines.append(declaration(f"{causality}{_type_of(v).capitalize()}", v, attributes))
    for d in layout.discretes:
        lines.append(declaration(f"output {_type_of(d).capitalize()}", d, {}, name=_next(d)))
    return lines


def _next(d: Declaration) -> str:
    """Return the name of what a sample makes of a discrete state."""
    return identifier(f"next_{d.name}")


def _type_of(v: Declaration) -> str:
    """Return the type of a variable; an integer is a real, as pymoca does not round."""
    return "boolean" if v.type == "boolean" else "real"


def _without_division(operation: int, operands: list[ExpressionNode]) -> ExpressionNode:
    """Return the expression of an operation, with a power in the place of a division."""
    if operation not in (ca.OP_DIV, ca.OP_INV):
        return apply(operation, operands)
    inverse = apply(ca.OP_POW, [operands[-1], constant(-1.0)])
    return inverse if operation == ca.OP_INV else apply(ca.OP_MUL, [operands[0], inverse])
