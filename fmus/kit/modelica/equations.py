"""Equations that define variables by expressions, with auxiliary variables for what they share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from fmus.kit.modelica.expressions import Node, Writer
from fmus.kit.modelica.names import identifier

_SIGNS = {ca.OP_NEG, ca.OP_NOT}
_WRITTEN_TWICE = {ca.OP_EQ, ca.OP_NE}  # operands, for want of an equality of Real


@dataclass(frozen=True)
class Target:
    """A variable, or its derivative, that an equation defines.

    Attributes
    ----------
    text : str
        The left-hand side.
    type : {"real", "integer", "boolean"}
    node : Node
        The right-hand side.
    """

    text: str
    type: str
    node: Node

    @property
    def is_its_node(self) -> bool:
        """Whether the variable can stand for the expression: it is of the same type."""
        return self.type == ("boolean" if self.node.is_boolean else "real")


@dataclass(frozen=True)
class Auxiliary:
    """A variable for an expression that a law gives, or that stands in several places.

    Attributes
    ----------
    name : str
    node : Node
    law : str
        Empty if no law gives it.
    """

    name: str
    node: Node
    law: str

    @property
    def type(self) -> str:
        """Type of the variable."""
        return "boolean" if self.node.is_boolean else "real"


@dataclass(frozen=True)
class Equations:
    """Equations with their auxiliary variables.

    Attributes
    ----------
    auxiliaries : list of Auxiliary
    lines : list of str
    """

    auxiliaries: list[Auxiliary]
    lines: list[str]


def define(
    targets: Sequence[Target], laws: Mapping[Node, str], taken: set[str], truths: bool = True
) -> Equations:
    """Write the equations of some variables.

    Parameters
    ----------
    targets : sequence of Target
    laws : Mapping of Node to str
        What laws give, by expression.
    taken : set of str
        Names that are in use, to which those of auxiliary variables are added.
    truths : bool
        Whether variables of type Boolean may stand for expressions.

    Returns
    -------
    Equations
    """
    names: dict[Node, str] = {}
    for target in targets:
        is_variable = "(" not in target.text
        can_stand = truths or target.type != "boolean"
        if is_variable and can_stand and target.is_its_node and not target.node.is_leaf:
            names.setdefault(target.node, target.text)
    auxiliaries = []
    for node in _shared([t.node for t in targets], laws, truths):
        if node not in names:
            law = laws.get(node, "")
            name = _name_of_law(law, taken) if law else _numbered(taken)
            taken.add(name)
            names[node] = name
            auxiliaries.append(Auxiliary(name, node, law))
    writer = Writer(names)
    defined = [*(Target(a.name, a.type, a.node) for a in auxiliaries), *targets]
    lines = [f"{t.text} = {writer.define(t.node, t.text, t.type)};" for t in defined]
    return Equations(auxiliaries, lines)


def _name_of_law(law: str, taken: set[str]) -> str:
    """Return the name of a law, which another one stands for if it is evaluated at samples too."""
    return identifier(f"sampled_{law}" if law in taken else law, taken)


def _numbered(taken: set[str]) -> str:
    """Return a name for what has none."""
    return next(name for k in range(1, len(taken) + 2) if (name := f"term_{k}") not in taken)


def _shared(roots: Sequence[Node], laws: Mapping[Node, str], truths: bool) -> list[Node]:
    """Return the expressions that laws give, or that stand in several places, operands first."""
    order: dict[Node, None] = {}
    for root in roots:
        _visit(root, order)
    uses = Counter(roots)
    shared = []
    for node in reversed(order):
        is_sign = node.operation in _SIGNS and node.operands[0].is_leaf
        has_name = node in laws or (uses[node] > 1 and not is_sign)
        if has_name and (truths or not node.is_boolean):
            shared.append(node)
            times = 1
        else:
            times = uses[node]
        for operand in node.operands:
            uses[operand] += 2 * times if node.operation in _WRITTEN_TWICE else times
    return shared[::-1]


def _visit(node: Node, order: dict[Node, None]) -> None:
    """Note the place of an expression behind its operands."""
    if node in order or node.is_leaf:
        return
    for operand in node.operands:
        _visit(operand, order)
    order[node] = None
