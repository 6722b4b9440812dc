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
# what the value of an operation is called
_NOUNS = {
    ca.OP_ADD: "sum",
    ca.OP_SUB: "difference",
    ca.OP_MUL: "product",
    ca.OP_DIV: "quotient",
    ca.OP_SQ: "square",
    ca.OP_TWICE: "twice",
    ca.OP_INV: "reciprocal",
    ca.OP_NEG: "negative",
    ca.OP_POW: "power",
    ca.OP_CONSTPOW: "power",
    ca.OP_IF_ELSE_ZERO: "choice",
    _IF: "choice",
}
# what stands between the names of its operands, instead of the noun before them
_BETWEEN = {ca.OP_ADD: "plus", ca.OP_SUB: "minus", ca.OP_MUL: "times", ca.OP_DIV: "over"}
EQUALITIES = {ca.OP_EQ, ca.OP_NE}


class _Form(NamedTuple):
    """The text of an operation.

    Attributes
    ----------
    text : str
        With ``{}`` in the place of each operand.
    precedence : int
    operands : tuple of int
        Lowest precedence of each operand that needs no brackets.
    conditions : int
        Number of operands of type Boolean, which are the first ones.
    """

    text: str
    precedence: int
    operands: tuple[int, ...]
    conditions: int = 0


_TEXT_OF_CHOICE = "if {} then {} else {}"
_BRANCHES = (_CHOICE, _OR, _CHOICE)  # no brackets around a choice as the last one: `else if`
_FORMS = {
    ca.OP_ADD: _Form("{} + {}", _SUM, (_SUM, _PRODUCT)),
    ca.OP_SUB: _Form("{} - {}", _SUM, (_SUM, _PRODUCT)),
    ca.OP_NEG: _Form("-{}", _SUM, (_PRODUCT,)),
    ca.OP_MUL: _Form("{} * {}", _PRODUCT, (_PRODUCT, _POWER)),
    ca.OP_DIV: _Form("{} / {}", _PRODUCT, (_PRODUCT, _POWER)),
    ca.OP_TWICE: _Form("2.0 * {}", _PRODUCT, (_POWER,)),
    ca.OP_INV: _Form("1.0 / {}", _PRODUCT, (_POWER,)),
    ca.OP_SQ: _Form("{} ^ 2", _POWER, (_PRIMARY,)),
    ca.OP_POW: _Form("{} ^ {}", _POWER, (_PRIMARY, _PRIMARY)),
    ca.OP_CONSTPOW: _Form("{} ^ {}", _POWER, (_PRIMARY, _PRIMARY)),
    ca.OP_LT: _Form("{} < {}", _RELATION, (_SUM, _SUM)),
    ca.OP_LE: _Form("{} <= {}", _RELATION, (_SUM, _SUM)),
    # Modelica has no equality of Reals
    ca.OP_EQ: _Form("{0} >= {1} and {0} <= {1}", _AND, (_SUM, _SUM)),
    ca.OP_NE: _Form("{0} < {1} or {0} > {1}", _OR, (_SUM, _SUM)),
    _IF: _Form(_TEXT_OF_CHOICE, _CHOICE, _BRANCHES, 1),
}
_FORMS_OF_TRUTHS = {
    ca.OP_AND: _Form("{} and {}", _AND, (_AND, _AND), 2),
    ca.OP_OR: _Form("{} or {}", _OR, (_OR, _OR), 2),
    ca.OP_NOT: _Form("not {}", _NOT, (_RELATION,), 1),
    ca.OP_EQ: _Form("{} == {}", _RELATION, (_PRIMARY, _PRIMARY), 2),
    ca.OP_NE: _Form("not ({} == {})", _NOT, (_PRIMARY, _PRIMARY), 2),
    ca.OP_IF_ELSE_ZERO: _Form("{} and {}", _AND, (_AND, _AND), 2),
    _IF: _Form(_TEXT_OF_CHOICE, _CHOICE, _BRANCHES, 3),
}
_TRUTHS = {ca.OP_LT, ca.OP_LE, ca.OP_AND, ca.OP_OR, ca.OP_NOT, *EQUALITIES}


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
    noun = _NOUNS.get(node.operation, f"{function}_value")
    operands = [names.get(o, o.text) for o in node.operands]
    words = [re.sub(r"^pre\((.*)\)$", r"\1", text) for text in operands]
    if not all(words):
        return noun
    if node.operation in _BETWEEN:
        name = f"_{_BETWEEN[node.operation]}_".join(words)
    else:
        name = "_".join([noun.removesuffix("_value"), *words])
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

    def _named(self, node: ExpressionNode) -> _Text:
        """Write an expression, or the variable that replaces it."""
        if node in self.names:
            return _Text(self.names[node], _PRIMARY)
        return self._operation(node)

    def _operation(self, node: ExpressionNode) -> _Text:
        """Write an expression by its operation, also if a variable replaces it."""
        if node.operation == _SYMBOL:
            return _Text(node.text, _PRIMARY)
        if node.operation == _CONSTANT:
            return _Text(real(node.value), _PRIMARY if node.value >= 0.0 else _SUM)
        if node.operation in _FUNCTIONS:
            arguments = ", ".join(_to_real(o, self._named(o)).text for o in node.operands)
            return _Text(f"{_FUNCTIONS[node.operation]}({arguments})", _PRIMARY)
        if node.operation == ca.OP_IF_ELSE_ZERO and not node.is_boolean:
            node = _with_both_branches(*node.operands)
        form = _form(node)
        operands = []
        for k, (operand, precedence) in enumerate(zip(node.operands, form.operands, strict=True)):
            convert = _to_boolean if k < form.conditions else _to_real
            operands.append(convert(operand, self._named(operand)).within(precedence))
        return _Text(form.text.format(*operands), form.precedence)


def _with_both_branches(condition: ExpressionNode, yes: ExpressionNode) -> ExpressionNode:
    """Return the choice between a value and zero, without a negation of its condition."""
    if condition.operation == ca.OP_NOT:
        return ExpressionNode(_IF, (condition.operands[0], constant(0.0), yes))
    return ExpressionNode(_IF, (condition, yes, constant(0.0)))


def _form(node: ExpressionNode) -> _Form:
    """Return the text of an operation by the types of its operands."""
    has_truths = node.is_boolean
    if node.operation in EQUALITIES:
        has_truths = all(o.is_boolean for o in node.operands)
    if has_truths and node.operation in _FORMS_OF_TRUTHS:
        return _FORMS_OF_TRUTHS[node.operation]
    if node.operation not in _FORMS:
        raise UserError(f"a law calls {_casadi_name(node.operation)}, which Modelica does not have")
    return _FORMS[node.operation]


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
