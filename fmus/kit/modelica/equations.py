"""Modelica equations that define variables, with auxiliary variables for common subexpressions."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from fmus.kit.modelica.expressions import ExpressionNode, Writer, described
from fmus.kit.modelica.names import identifier

_RELATION = re.compile("[<>]")
_SIGNS = {ca.OP_NEG, ca.OP_NOT}
# operations whose text has the operands twice, as Modelica has no equality of Reals
_OPERANDS_WRITTEN_TWICE = {ca.OP_EQ, ca.OP_NE}


@dataclass(frozen=True)
class Target:
    """A variable, or its derivative, that an equation defines.

    Attributes
    ----------
    text : str
        The left-hand side.
    type : {"real", "integer", "boolean"}
    node : ExpressionNode
        The right-hand side.
    """

    text: str
    type: str
    node: ExpressionNode


@dataclass(frozen=True)
class Auxiliary:
    """A variable of type Real for the value of a law, or for a common subexpression.

    Attributes
    ----------
    name : str
    node : ExpressionNode
    law : str
        Name of the law; empty for a common subexpression.
    """

    name: str
    node: ExpressionNode
    law: str


@dataclass(frozen=True)
class EquationSet:
    """Equations with their auxiliary variables.

    Attributes
    ----------
    auxiliaries : list of Auxiliary
    lines : list of str
    """

    auxiliaries: list[Auxiliary]
    lines: list[str]


def define(
    targets: Sequence[Target],
    laws: Mapping[ExpressionNode, str],
    intermediates: Mapping[ExpressionNode, str],
    taken: set[str],
    literal: bool = False,
) -> EquationSet:
    """Write the equations that define variables.

    No auxiliary variable is Boolean: it would keep its value until the next event.

    Parameters
    ----------
    targets : sequence of Target
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
            name = _name_of_law(law, taken) if law else ""
            name = name or _numbered(term or described(node, spoken), taken)
            taken.add(name)
            names[node] = name
            if law or term:
                spoken[node] = name
            auxiliaries.append(Auxiliary(name, node, law))
    writer = Writer(names)
    lines = []
    definitions = [Target(a.name, "real", a.node) for a in auxiliaries]
    for target in (*definitions, *targets):
        right = writer.define(target.node, target.text, target.type)
        if literal and target.type == "real" and _RELATION.search(right):
            right = f"noEvent({right})"
        lines.append(f"{target.text} = {right};")
    return EquationSet(auxiliaries, lines)


def _name_of_law(law: str, taken: set[str]) -> str:
    """Return the name of a law, or a second one if the law is also evaluated at samples."""
    return identifier(f"sampled_{law}" if law in taken else law, taken)


def _numbered(name: str, taken: set[str]) -> str:
    """Return a name for a common subexpression, with a number if it is in use."""
    number = 1
    numbered = name
    while numbered in taken or identifier(numbered) != numbered:
        number += 1
        numbered = f"{name}_{number}"
    return numbered


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
        per_text = 2 if node.operation in _OPERANDS_WRITTEN_TWICE else 1
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
