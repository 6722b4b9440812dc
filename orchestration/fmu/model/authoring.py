"""Mistakes in a user's model file: messages with the line and the correction."""

from __future__ import annotations

import ast
import re
import traceback
from collections.abc import Iterator
from pathlib import Path

from fmus.kit import quoting
from fmus.kit.declare import Declaration
from fmus.kit.errors import DeclarationError, UserError, suggestion

_UNKNOWN_ARGUMENT = re.compile(
    r"(\w+)Declaration\.__init__\(\) got an unexpected keyword .*'(\w+)'"
)
_KINDS = ("Parameter", "Input", "Output", "State", "Discrete", "Text")


def check_names(path: Path, text: bytes) -> None:
    """Raise UserError if a class body redefines the name of a variable.

    Python would ignore the variable.

    Parameters
    ----------
    path : Path
    text : bytes
        Contents of the file, which is not checked if Python cannot parse it.

    Raises
    ------
    UserError
        With the lines of both definitions.
    """
    try:
        classes = _classes(text)
    except (SyntaxError, ValueError):
        return
    for body in classes:
        lines: dict[str, int] = {}
        for name, line, is_variable in _definitions(body):
            if name in lines:
                raise UserError(
                    f"{path}, line {line}: {name!r} is a variable already, declared in line"
                    f" {lines[name]}; give this law another name, such as {name}_law"
                )
            if is_variable:
                lines[name] = line


def _classes(text: bytes) -> list[ast.ClassDef]:
    """Return the class definitions in the contents of a file."""
    return [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]


def _definitions(body: ast.ClassDef) -> Iterator[tuple[str, int, bool]]:
    """Yield names defined in a class body, their lines, and whether they declare variables."""
    for node in body.body:
        match node:
            case ast.FunctionDef(name=name, decorator_list=decorators):
                yield name, node.lineno, any(map(_is_declaration, decorators))
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield name, node.lineno, _is_declaration(value)


def _is_declaration(value: ast.expr) -> bool:
    """Return whether an expression is a call such as ``Output(...)``."""
    function = value.func if isinstance(value, ast.Call) else None
    return isinstance(function, ast.Name) and function.id in _KINDS


def remarks(path: Path, text: bytes, owner: str) -> tuple[str, ...]:
    """Return remarks on methods of a class that keep effects from changing one law alone.

    An effect of a diagnosis overrides methods: it cannot change a law that is computed inside an
    output, and changes the physics where another method calls an output.

    Parameters
    ----------
    path : Path
    text : bytes
        Contents of the file, which Python can parse.
    owner : str
        Name of the class.

    Returns
    -------
    tuple of str
        A remark for each such method, with its line and the correction.
    """
    lines = []
    for body in _classes(text):
        if body.name != owner:
            continue
        methods = [node for node in body.body if isinstance(node, ast.FunctionDef)]
        outputs = {
            method.name for method in methods if any(map(_is_declaration, method.decorator_list))
        }
        for method in methods:
            place = f"{path}, line {method.lineno}: {method.name}"
            calls = _calls_of_methods(method)
            if method.name in outputs and not calls and _computes(method):
                lines.append(
                    f"{place} computes a law inside an output, where no effect can change it; move"
                    f" it into a method of its own, such as true_{method.name}, and return"
                    f" self.true_{method.name}()"
                )
            called_outputs = sorted(calls & outputs)
            if called_outputs:
                lines.append(
                    f"{place} calls the output {called_outputs[0]}, so that an error of its sensor"
                    " would change the physics; let both call a law"
                )
    return tuple(lines)


def _calls_of_methods(method: ast.FunctionDef) -> set[str]:
    """Return the names of the methods of `self` that a method calls."""
    return {
        node.func.attr
        for node in ast.walk(method)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "self"
    }


def _computes(method: ast.FunctionDef) -> bool:
    """Return whether a method contains an arithmetic operation."""
    return any(isinstance(node, ast.BinOp) for node in ast.walk(method))


def describe(path: Path, text: bytes, error: BaseException) -> str:
    """Return a message of one line for an error in a user's file, with the line of the file.

    Parameters
    ----------
    path : Path
    text : bytes
        Contents of the file.
    error : BaseException
        The error raised by running the file.

    Returns
    -------
    str
    """
    line = _line_number(path, text, error)
    place = f"{path}, line {line}" if line else str(path)
    module = (
        rf"\b{quoting.identifier(path.stem, 'model')}_[0-9a-f]{{12}}\."  # as `loading` names it
    )
    description = re.sub(module, "", _description(error))
    description = re.sub(r"(?<=\w)_[0-9a-f]{12}(?=')", "", description)  # of a file beside it
    return f"{place}: {quoting.line(description)}"


def line_of(text: bytes, owner: str, variable: str = "") -> int | None:
    """Return the line on which a class, or a variable in it, is declared.

    Parameters
    ----------
    text : bytes
        Contents of a file that Python can parse.
    owner : str
        Name of the class.
    variable : str

    Returns
    -------
    int or None
        The line of the class if it does not declare the variable; None without the class.
    """
    for body in _classes(text):
        if body.name == owner:
            lines = {name: line for name, line, _ in _definitions(body)}
            return lines.get(variable, body.lineno)
    return None


def _line_number(path: Path, text: bytes, error: BaseException) -> int | None:
    """Return the line of a user's file to which an error refers; None if it refers to none."""
    if isinstance(error, SyntaxError):
        return error.lineno
    if isinstance(error, DeclarationError):
        line = line_of(text, error.owner, error.variable)
        if line:
            return line
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f.lineno for f in frames if Path(f.filename).absolute() == path.absolute()]
    return lines[-1] if lines else None


def _description(error: BaseException) -> str:
    """Return the text of an error, with a correction for unknown arguments and names."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg}"
    if isinstance(error, UserError) and str(error):
        return str(error)
    match = _UNKNOWN_ARGUMENT.search(str(error))
    if match:
        known = Declaration.__dataclass_fields__
        return f"{match[1]} takes no argument {match[2]!r}{suggestion(match[2], known)}"
    if isinstance(error, NameError) and error.name in _kit_names():
        return f"{error.name} is not imported; write: from fmus.kit import {error.name}"
    return ": ".join(filter(None, (type(error).__name__, str(error))))


def _kit_names() -> list[str]:
    """Return the public names of `fmus.kit`."""
    import fmus.kit

    return fmus.kit.__all__
