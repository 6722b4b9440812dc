"""Components as flat classes for pymoca 0.12, which gives their equations to CasADi.

It loses connectors that are one number, has no ``sample``, ``pre`` and ``noEvent``, and divides by
a method that CasADi 3.8 lacks. Here a class has no connectors: inputs are inputs. What is sampled
is an input, held between samples, and an output ``next_NAME`` that is its value after a sample of
its clock. Clocks that coincide are sampled in the order of their declaration.
"""

from __future__ import annotations

import casadi as ca

from fmus.kit.declare import Declaration, summary
from fmus.kit.modelica.declarations import declaration, declared_identifiers, literal
from fmus.kit.modelica.equations import Target, define
from fmus.kit.modelica.expressions import ExpressionNode, apply, constant
from fmus.kit.modelica.model import TracedModel
from fmus.kit.modelica.names import class_name, comment, identifier, indented, wrapped


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
    layout = model.layout
    graph = model.graph
    texts = {v.name: identifier(v.name) for v in layout.variables}
    rates, outputs, *updates, laws, intermediates = model.expression_nodes(
        texts, [graph.rates, graph.outputs, *graph.updates], _without_division
    )
    places = {d.name: k for k, d in enumerate(layout.discretes)}
    sampled = {
        d.name: after[places[d.name]]
        for (_, members), after in zip(layout.sampled, updates, strict=True)
        for d in members
    }
    targets = [
        Target(f"der({texts[s.name]})", "real", node)
        for s, node in zip(layout.states, rates, strict=True)
    ]
    targets += [
        Target(texts[o.name], _type_of(o), node)
        for o, node in zip(layout.outputs, outputs, strict=True)
    ]
    targets += [Target(_next(d), _type_of(d), sampled[d.name]) for d in layout.discretes]
    taken = declared_identifiers(model.cls) | set(map(_next, layout.discretes))
    equations = define(targets, *model.names_of(laws, intermediates), taken)
    name = class_name(model.cls.name)
    lines = [
        f"model {name}{comment(summary(model.cls))}",
        *indented(_declarations(model)),
        "protected",
        *indented([model.auxiliary(each) for each in equations.auxiliaries]),
        "equation",
        *wrapped(map(_with_built_in_functions, equations.lines)),
        f"end {name};",
    ]
    return "\n".join(lines) + "\n"


def _declarations(model: TracedModel) -> list[str]:
    """Write the declarations of parameters, inputs, states and outputs."""
    layout = model.layout
    starts = {name: {"start": identifier(start)} for name, start in layout.start_of.items()}
    lines = [
        declaration(f"parameter {p.type.capitalize()}", p, {}, literal(p.start, p.type))
        for p in layout.parameters
    ]
    for v in layout.inputs:
        start = {"start": literal(v.start, v.type)}
        lines.append(declaration(_prefixed("input", v), v, start))
    lines += [declaration(_prefixed("input", d), d, starts[d.name]) for d in layout.discretes]
    for s in layout.states:
        prefix = "output Real" if s.output else "Real"
        lines.append(declaration(prefix, s, starts[s.name] | {"fixed": "true"}))
    lines += [declaration(_prefixed("output", o), o, {}) for o in layout.outputs]
    lines += [declaration(_prefixed("output", d), d, {}, name=_next(d)) for d in layout.discretes]
    return lines


def _next(d: Declaration) -> str:
    """Return the name of what a sample makes of a discrete state."""
    return identifier(f"next_{d.name}")


def _with_built_in_functions(line: str) -> str:
    """Return an equation that calls CasADi's functions, which have no events either."""
    return line.replace("Functions.roundedDown(", "floor(").replace("Functions.roundedUp(", "ceil(")


def _type_of(v: Declaration) -> str:
    """Return the type of a variable that an equation defines; pymoca does not round."""
    return "boolean" if v.type == "boolean" else "real"


def _prefixed(causality: str, v: Declaration) -> str:
    return f"{causality} {_type_of(v).capitalize()}"


def _without_division(operation: int, operands: list[ExpressionNode]) -> ExpressionNode:
    """Return the expression of an operation, with a power in the place of a division."""
    if operation == ca.OP_HYPOT:
        squares = [apply(ca.OP_SQ, [operand]) for operand in operands]
        return apply(ca.OP_SQRT, [apply(ca.OP_ADD, squares)])
    if operation not in (ca.OP_DIV, ca.OP_INV):
        return apply(operation, operands)
    inverse = apply(ca.OP_POW, [operands[-1], constant(-1.0)])
    return inverse if operation == ca.OP_INV else apply(ca.OP_MUL, [operands[0], inverse])
