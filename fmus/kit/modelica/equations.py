"""Modelica equations that define variables, with auxiliary variables for common subexpressions."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from fmus.kit.modelica.expressions import EQUALITIES, ExpressionNode, Writer, described
from fmus.kit.modelica.names import identifier

_RELATION = re.compile("[<>]")
_SIGNS = {ca.OP_NEG, ca.OP_NOT}


@dataclass(frozen=True)
class Definition:
    """A variable, or its derivative, that an equation defines.

    Attributes
    ----------
    text : str
        The left-hand side.
    type : {"real", "integer", "boolean"}
    node : ExpressionNode
        The right-hand side.
    law : str
        Name of the law whose value an auxiliary variable has; empty for others.
    """

    text: str
    type: str
    node: ExpressionNode
    law: str = ""


@dataclass(frozen=True)
class EquationSet:
    """Equations with their auxiliary variables.

    Attributes
    ----------
    auxiliaries : list of Definition
        Variables of type Real for values of laws and for common subexpressions.
    lines : list of str
    """

    auxiliaries: list[Definition]
    lines: list[str]


def define(
    targets: Sequence[Definition],
    laws: Mapping[ExpressionNode, str],
    intermediates: Mapping[ExpressionNode, str],
    taken: set[str],
    literal: bool = False,
) -> EquationSet:
    """Write the equations that define variables.

    No auxiliary variable is Boolean: it would keep its value until the next event.

    Parameters
    ----------
    targets : sequence of Definition
    laws : Mapping of ExpressionNode to str
        Name of the law by the expression for its value.
    intermediates : Mapping of ExpressionNode to str
        Names for common subexpressions; others are named after what they compute.
    taken : set of str
        Names in use; the names of auxiliary variables are added.
    literal : bool
        Whether relations within a Real are evaluated at every point, without events.

    Returns
    -------
    EquationSet
    """
    names: dict[ExpressionNode, str] = {}
    for target in targets:
        is_real_variable = target.type == "real" and "(" not in target.text  # no der(x)
        if is_real_variable and not (target.node.is_boolean or target.node.is_leaf):
            names.setdefault(target.node, target.text)
    auxiliaries = []
    spoken = dict(names)  # those that others are composed of
    for node in _nodes_with_names([t.node for t in targets], laws):
        if node not in names:
            law = laws.get(node, "")
            term = intermediates.get(node, "")
            names[node] = _auxiliary_name(law, term or described(node, spoken), taken)
            taken.add(names[node])
            if law or term:
                spoken[node] = names[node]
            auxiliaries.append(Definition(names[node], "real", node, law))
    writer = Writer(names)
    lines = []
    for target in (*auxiliaries, *targets):
        right = writer.define(target.node, target.text, target.type)
        if literal and target.type == "real" and _RELATION.search(right):
            right = f"noEvent({right})"
        lines.append(f"{target.text} = {right};")
    return EquationSet(auxiliaries, lines)


def _auxiliary_name(law: str, term: str, taken: set[str]) -> str:
    """Return a free name: of a law, which may also be evaluated at samples, or of a term."""
    if law:
        return identifier(f"sampled_{law}" if law in taken else law, taken)
    name = term
    number = 1
    while name in taken or identifier(name) != name:
        number += 1
        name = f"{term}_{number}"
    return name


def _nodes_with_names(
    roots: Sequence[ExpressionNode], laws: Mapping[ExpressionNode, str]
) -> list[ExpressionNode]:
    """Return the nodes that become variables: values of laws, and common subexpressions.

    Operands come before the nodes that use them. A common subexpression is one that the text of the
    equations would have more than once; the text of a node with a name is written once.
    """
    order: dict[ExpressionNode, None] = {}
    for root in roots:
        _append_after_operands(root, order)
    uses = Counter(roots)  # how often the text of each node would be written
    named = []
    for node in reversed(order):  # before its operands
        is_sign = node.operation in _SIGNS and node.operands[0].is_leaf
        has_name = not node.is_boolean and (node in laws or (uses[node] > 1 and not is_sign))
        if has_name:
            named.append(node)
        written = 1 if has_name else uses[node]
        # Modelica has no equality of Reals, in whose place the operands stand twice
        per_text = 2 if node.operation in EQUALITIES else 1
        for operand in node.operands:
            uses[operand] += per_text * written
    return named[::-1]


def _append_after_operands(node: ExpressionNode, order: dict[ExpressionNode, None]) -> None:
    """Append an expression to an ordered set after its operands; omit symbols and constants."""
    if node in order or node.is_leaf:
        return
    for operand in node.operands:
        _append_after_operands(operand, order)
    order[node] = None
