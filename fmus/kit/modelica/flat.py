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
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import Layout
from fmus.kit.modelica.declarations import declaration, declared_identifiers, literal
from fmus.kit.modelica.expressions import ExpressionNode, apply, constant
from fmus.kit.modelica.model import TracedModel
from fmus.kit.modelica.names import class_name, comment, identifier, indented, wrapped

# functions of the package, by those of CasADi, which have no events either
_BUILT_IN = {"roundedDown": "floor", "roundedUp": "ceil", "hypotenuse": "hypot"}
_FUNCTION = re.compile(r"Functions\.(\w+)")


@uninterrupted()
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
    clocks = {d.name: k for k, (_, members) in enumerate(layout.sampled) for d in members}
    sampled = [graph.updates[clocks[d.name]][k] for k, d in enumerate(layout.discretes)]
    left = [f"der({texts[s.name]})" for s in layout.states]
    left += [texts[o.name] for o in layout.outputs]
    left += map(_next, layout.discretes)
    right = ca.vertcat(graph.rates, graph.outputs, *sampled)
    taken = declared_identifiers(model.cls) | set(left)
    types = dict.fromkeys(left, "real")
    equations = model.equations(types, right, texts, taken, operation=_without_division)
    name = class_name(model.cls.name)
    lines = [
        f"model {name}{comment(summary(model.cls))}",
        *indented(_declarations(layout)),
        "protected",
        *indented(map(model.auxiliary, equations.auxiliaries)),
        "equation",
        *wrapped(_FUNCTION.sub(lambda match: _BUILT_IN[match[1]], x) for x in equations.lines),
        f"end {name};\n",
    ]
    return "\n".join(lines)


def _declarations(layout: Layout) -> list[str]:
    """Write the declarations of variables; outputs are Real, also truth values and counts."""
    starts = {name: {"start": identifier(start)} for name, start in layout.start_of.items()}
    return [
        *(
            declaration(f"parameter {p.type.capitalize()}", p, {}, literal(p.start, p.type))
            for p in layout.parameters
        ),
        *(
            declaration(f"input {v.type.capitalize()}", v, starts.get(v.name, {}))
            for v in (*layout.inputs, *layout.discretes)
        ),
        *(declaration("output " * s.output + "Real", s, starts[s.name]) for s in layout.states),
        *(declaration("output Real", o, {}) for o in layout.outputs),
        *(declaration("output Real", d, {}, name=_next(d)) for d in layout.discretes),
    ]


def _next(d: Declaration) -> str:
    """Return the name of what a sample makes of a discrete state."""
    return identifier(f"next_{d.name}")


def _without_division(operation: int, operands: list[ExpressionNode]) -> ExpressionNode:
    """Return the expression of an operation, with a power in the place of a division."""
    if operation not in (ca.OP_DIV, ca.OP_INV):
        return apply(operation, operands)
    inverse = apply(ca.OP_POW, [operands[-1], constant(-1.0)])
    return inverse if operation == ca.OP_INV else apply(ca.OP_MUL, [operands[0], inverse])
