"""Modelica expressions from the expression graph of a component's laws.

The graph has only numbers, where 0 is false; Modelica distinguishes Boolean from Real. An
expression is Boolean if the result of its operation is a truth value, or a choice between truth
values. It is converted where the other type is needed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from fmus.kit.errors import UserError
from fmus.kit.modelica.names import real

# precedence of operators, from the lowest to the highest (section 3.2)
_CHOICE, _OR, _AND, _NOT, _RELATION, _SUM, _PRODUCT, _POWER, _PRIMARY = range(9)
_INFIX = {
    ca.OP_ADD: ("+", _SUM),
    ca.OP_SUB: ("-", _SUM),
    ca.OP_MUL: ("*", _PRODUCT),
    ca.OP_DIV: ("/", _PRODUCT),
}
_RELATIONS = {ca.OP_LT: "<", ca.OP_LE: "<="}
_LOGICAL = {ca.OP_AND: ("and", _AND), ca.OP_OR: ("or", _OR)}
_FUNCTIONS = {
    ca.OP_ACOS: "acos",
    ca.OP_ASIN: "asin",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_CEIL: "Functions.roundedUp",
    ca.OP_COS: "cos",
    ca.OP_COSH: "cosh",
    ca.OP_EXP: "exp",
    ca.OP_FABS: "abs",
    ca.OP_FLOOR: "Functions.roundedDown",
    ca.OP_FMAX: "max",
    ca.OP_FMIN: "min",
    ca.OP_HYPOT: "Functions.hypotenuse",
    ca.OP_LOG: "log",
    ca.OP_SIGN: "sign",
    ca.OP_SIN: "sin",
    ca.OP_SINH: "sinh",
    ca.OP_SQRT: "sqrt",
    ca.OP_TAN: "tan",
    ca.OP_TANH: "tanh",
}
_LONGEST_NAME = 40  # composed of names of operands
_SYMBOL, _CONSTANT, _IF = -1, -2, -3  # further kinds of nodes, which are no CasADi operations
# how the value of an operation is called, and what stands between the names of its operands
_NOUNS = {
    ca.OP_ADD: ("sum", "plus"),
    ca.OP_SUB: ("difference", "minus"),
    ca.OP_MUL: ("product", "times"),
    ca.OP_DIV: ("quotient", "over"),
    ca.OP_SQ: ("square", ""),
    ca.OP_TWICE: ("twice", ""),
    ca.OP_INV: ("reciprocal", ""),
    ca.OP_NEG: ("negative", ""),
    ca.OP_POW: ("power", ""),
    ca.OP_CONSTPOW: ("power", ""),
    ca.OP_IF_ELSE_ZERO: ("choice", ""),
    _IF: ("choice", ""),
}
_EQUALITIES = {ca.OP_EQ, ca.OP_NE}
_TRUTHS = {*_RELATIONS, *_LOGICAL, *_EQUALITIES, ca.OP_NOT}


@dataclass(frozen=True, eq=False)
class ExpressionNode:
    """An expression; two are equal only if they are the same object.

    Attributes
    ----------
    operation : int
        CasADi's operation, or the code of a symbol, a constant or a choice.
    operands : tuple of ExpressionNode
    text : str
        Text of a symbol.
    value : float
        Value of a constant.
    is_boolean : bool
    """

    operation: int
    operands: tuple[ExpressionNode, ...] = ()
    text: str = ""
    value: float = 0.0
    is_boolean: bool = False

    @property
    def is_leaf(self) -> bool:
        """True for a symbol or a constant."""
        return not self.operands


def symbol(text: str, is_boolean: bool = False) -> ExpressionNode:
    """Return a symbol with a text."""
    return ExpressionNode(_SYMBOL, text=text, is_boolean=is_boolean)


def constant(value: float) -> ExpressionNode:
    """Return a constant."""
    return ExpressionNode(_CONSTANT, value=value)


def apply(operation: int, operands: list[ExpressionNode]) -> ExpressionNode:
    """Return the expression of an operation of CasADi.

    Parameters
    ----------
    operation : int
    operands : list of ExpressionNode

    Returns
    -------
    ExpressionNode
        A choice for CasADi's form of one, ``(c ? a : 0) + (!c ? b : 0)``.
    """
    if operation == ca.OP_ADD:
        for first, second in (operands, operands[::-1]):
            if _are_branches(first, second):
                branches = first.operands[1], second.operands[1]
                return ExpressionNode(
                    _IF, (first.operands[0], *branches), is_boolean=_is_boolean_choice(*branches)
                )
    is_choice = operation == ca.OP_IF_ELSE_ZERO
    is_boolean = operands[1].is_boolean if is_choice else operation in _TRUTHS
    return ExpressionNode(operation, tuple(operands), is_boolean=is_boolean)


def described(node: ExpressionNode, names: Mapping[ExpressionNode, str]) -> str:
    """Return a name for an expression after what it computes.

    Parameters
    ----------
    node : ExpressionNode
    names : Mapping of ExpressionNode to str
        Names of other expressions.

    Returns
    -------
    str
        Composed of the names of its operands, such as ``sin_angle`` or ``R1_plus_R2``; the
        operation, such as ``product``, if they have none or are long.
    """
    function = _FUNCTIONS.get(node.operation, "").rpartition(".")[2]
    noun, between = _NOUNS.get(node.operation, (f"{function}_value", ""))
    operands = [names.get(o, o.text) for o in node.operands]
    words = [re.sub(r"^pre\((.*)\)$", r"\1", text) for text in operands]
    if not all(words):
        return noun
    name = (
        f"_{between}_".join(words) if between else "_".join([noun.removesuffix("_value"), *words])
    )
    return name if len(name) <= _LONGEST_NAME else noun


def _are_branches(first: ExpressionNode, second: ExpressionNode) -> bool:
    """Return whether two summands are ``c ? a : 0`` and ``!c ? b : 0`` for one condition c."""
    if not first.operation == second.operation == ca.OP_IF_ELSE_ZERO:
        return False
    otherwise = second.operands[0]
    return otherwise.operation == ca.OP_NOT and otherwise.operands[0] is first.operands[0]


def _is_boolean_choice(yes: ExpressionNode, no: ExpressionNode) -> bool:
    """Return whether a choice is Boolean: one branch is Boolean, the other is too, or is 0 or 1."""
    if not (yes.is_boolean or no.is_boolean):
        return False
    return all(b.is_boolean or (b.operation == _CONSTANT and b.value in (0, 1)) for b in (yes, no))


class _Text(NamedTuple):
    """A written expression, and the precedence of its outermost operator."""

    text: str
    precedence: int

    def within(self, precedence: int) -> str:
        """Return the text as an operand, in brackets if its precedence is lower."""
        return self.text if self.precedence >= precedence else f"({self.text})"


@dataclass(frozen=True)
class Writer:
    """Writer of expressions.

    Attributes
    ----------
    names : Mapping of ExpressionNode to str
        Name of the variable that replaces an expression.
    """

    names: Mapping[ExpressionNode, str]

    def define(self, node: ExpressionNode, variable: str, type: str) -> str:
        """Write the expression that defines a variable.

        Parameters
        ----------
        node : ExpressionNode
        variable : str
        type : {"real", "integer", "boolean"}
            Type of the variable.

        Returns
        -------
        str
        """
        written = self._operation(node) if self.names.get(node) == variable else self._named(node)
        if type == "boolean":
            return _to_boolean(node, written).text
        if type == "integer":  # Modelica's integer() rounds down
            return f"integer({_to_real(node, written).within(_SUM)} + 0.5)"
        return _to_real(node, written).text

    def _real(self, node: ExpressionNode) -> _Text:
        """Write an expression, or the variable that replaces it, as a Real."""
        return _to_real(node, self._named(node))

    def _boolean(self, node: ExpressionNode) -> _Text:
        """Write an expression, or the variable that replaces it, as a Boolean."""
        return _to_boolean(node, self._named(node))

    def _named(self, node: ExpressionNode) -> _Text:
        """Write an expression, or the variable that replaces it."""
        if node in self.names:
            return _Text(self.names[node], _PRIMARY)
        return self._operation(node)

    def _operation(self, node: ExpressionNode) -> _Text:
        """Write an expression by its operation, also if a variable replaces it."""
        operation = node.operation
        if operation == _SYMBOL:
            return _Text(node.text, _PRIMARY)
        if operation == _CONSTANT:
            return _Text(real(node.value), _PRIMARY if node.value >= 0.0 else _SUM)
        if node.is_boolean:
            return self._boolean_operation(node)
        if operation in _INFIX:
            sign, precedence = _INFIX[operation]
            left, right = map(self._real, node.operands)
            text = f"{left.within(precedence)} {sign} {right.within(precedence + 1)}"
            return _Text(text, precedence)
        if operation in _FUNCTIONS:
            arguments = ", ".join(self._real(o).text for o in node.operands)
            return _Text(f"{_FUNCTIONS[operation]}({arguments})", _PRIMARY)
        return self._special_operation(node)

    def _special_operation(self, node: ExpressionNode) -> _Text:
        """Write a choice, a negation, a power, or CasADi's operations for 2 x and 1 / x."""
        match node.operation:
            case ca.OP_NEG:
                return _Text(f"-{self._real(node.operands[0]).within(_PRODUCT)}", _SUM)
            case ca.OP_TWICE:
                return _Text(f"2.0 * {self._real(node.operands[0]).within(_POWER)}", _PRODUCT)
            case ca.OP_INV:
                return _Text(f"1.0 / {self._real(node.operands[0]).within(_POWER)}", _PRODUCT)
            case ca.OP_SQ:
                return _Text(f"{self._real(node.operands[0]).within(_PRIMARY)} ^ 2", _POWER)
            case ca.OP_POW | ca.OP_CONSTPOW:
                base, exponent = (self._real(o).within(_PRIMARY) for o in node.operands)
                return _Text(f"{base} ^ {exponent}", _POWER)
            case _ if node.operation == _IF:
                condition, yes, no = node.operands
                return self._choice(condition, self._real(yes), self._real(no))
            case ca.OP_IF_ELSE_ZERO:
                condition, yes = node.operands
                branches = self._real(yes), _Text("0.0", _PRIMARY)
                if condition.operation == ca.OP_NOT and condition not in self.names:
                    return self._choice(condition.operands[0], *branches[::-1])
                return self._choice(condition, *branches)
        raise UserError(f"a law calls {_casadi_name(node.operation)}, which Modelica does not have")

    def _choice(self, condition: ExpressionNode, yes: _Text, no: _Text) -> _Text:
        # a choice as the last branch needs no brackets: `else if`
        text = f"if {self._boolean(condition).text} then {yes.within(_OR)} else {no.text}"
        return _Text(text, _CHOICE)

    def _boolean_operation(self, node: ExpressionNode) -> _Text:
        """Write an expression of type Boolean."""
        operation = node.operation
        if operation in _RELATIONS:
            left, right = (self._real(o).within(_SUM) for o in node.operands)
            return _Text(f"{left} {_RELATIONS[operation]} {right}", _RELATION)
        if operation in _LOGICAL:
            word, precedence = _LOGICAL[operation]
            left, right = (self._boolean(o).within(precedence) for o in node.operands)
            return _Text(f"{left} {word} {right}", precedence)
        if operation == ca.OP_NOT:
            return _Text(f"not {self._boolean(node.operands[0]).within(_RELATION)}", _NOT)
        if operation in _EQUALITIES:
            return self._equality(node)
        condition = node.operands[0]
        if operation == ca.OP_IF_ELSE_ZERO:
            parts = (self._boolean(o).within(_AND) for o in node.operands)
            return _Text(" and ".join(parts), _AND)
        yes, no = map(self._boolean, node.operands[1:])
        return self._choice(condition, yes, no)

    def _equality(self, node: ExpressionNode) -> _Text:
        """Write ``==`` or its negation; of two Reals by ``<`` and ``>``, for want of ``==``."""
        is_equal = node.operation == ca.OP_EQ
        if all(o.is_boolean for o in node.operands):
            left, right = (self._boolean(o).within(_PRIMARY) for o in node.operands)
            text = f"{left} == {right}"
            return _Text(text, _RELATION) if is_equal else _Text(f"not ({text})", _NOT)
        left, right = (self._real(o).within(_SUM) for o in node.operands)
        if is_equal:
            return _Text(f"{left} >= {right} and {left} <= {right}", _AND)
        return _Text(f"{left} < {right} or {left} > {right}", _OR)


def _casadi_name(operation: int) -> str:
    """Return CasADi's name of an operation, in lower case."""
    names = (name for name in dir(ca) if getattr(ca, name) == operation)
    return next(n.removeprefix("OP_").lower() for n in names if n.startswith("OP_"))


def _to_real(node: ExpressionNode, written: _Text) -> _Text:
    if not node.is_boolean:
        return written
    return _Text(f"if {written.text} then 1.0 else 0.0", _CHOICE)


def _to_boolean(node: ExpressionNode, written: _Text) -> _Text:
    if node.is_boolean:
        return written
    if node.operation == _CONSTANT:
        return _Text("true" if node.value else "false", _PRIMARY)
    return _Text(f"abs({written.text}) > 0.0", _RELATION)
