"""Mistakes of authors in a model's file: on which line they are, and what to write instead."""

from __future__ import annotations

import ast
import re
import traceback
from collections.abc import Iterator
from pathlib import Path

from fmus.kit.declare import Declaration
from fmus.kit.errors import DeclarationError, UserError, suggestion

_UNKNOWN_ARGUMENT = re.compile(
    r"(\w+)Declaration\.__init__\(\) got an unexpected keyword .*'(\w+)'"
)
_KINDS = ("Parameter", "Input", "Output", "State", "Discrete", "Text")


def check_names(path: Path, text: bytes) -> None:
    """Check that no class body gives one name to a variable and to something after it.

    Python would forget the first one.

    Parameters
    ----------
    path : Path
    text : bytes
        What the file contains; any that Python cannot read has no class.

    Raises
    ------
    UserError
        With both lines.
    """
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return
    for body in (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)):
        first: dict[str, int] = {}
        for name, line, declares in _named(body):
            if name in first:
                raise UserError(
                    f"{path}, line {line}: {name!r} is a variable already, declared in line"
                    f" {first[name]}; give this law another name, such as {name}_law"
                )
            if declares:
                first[name] = line


def _named(body: ast.ClassDef) -> Iterator[tuple[str, int, bool]]:
    """Yield the names of a class body, with their lines, and whether each declares a variable."""
    for node in body.body:
        match node:
            case ast.FunctionDef(name=name, decorator_list=decorators):
                yield name, node.lineno, any(map(_declares, decorators))
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield name, node.lineno, _declares(value)


def _declares(value: ast.expr) -> bool:
    called = value.func if isinstance(value, ast.Call) else None
    return isinstance(called, ast.Name) and called.id in _KINDS


def remarks(path: Path, text: bytes, owner: str) -> tuple[str, ...]:
    """Return what works in a class, but hides a law from effects and diagnoses.

    Parameters
    ----------
    path : Path
    text : bytes
        Of a file that Python can read.
    owner : str
        Name of the class.

    Returns
    -------
    tuple of str
        With lines, and what to write instead.
    """
    told = []
    for body in (n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ClassDef)):
        if body.name != owner:
            continue
        methods = [node for node in body.body if isinstance(node, ast.FunctionDef)]
        outputs = {method.name for method in methods if any(map(_declares, method.decorator_list))}
        for method in methods:
            place = f"{path}, line {method.lineno}: {method.name}"
            called = _called(method)
            if method.name in outputs and not called and _computes(method):
                told.append(
                    f"{place} computes a law inside an output, where no effect can change it; move"
                    f" it into a method of its own, such as true_{method.name}, and return"
                    f" self.true_{method.name}()"
                )
            seen = sorted(called & outputs)
            if seen:
                told.append(
                    f"{place} calls the output {seen[0]}, so that an error of its sensor would"
                    " change the physics; let both call a law"
                )
    return tuple(told)


def _called(method: ast.FunctionDef) -> set[str]:
    """Return the methods of self that a method calls."""
    return {
        node.func.attr
        for node in ast.walk(method)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "self"
    }


def _computes(method: ast.FunctionDef) -> bool:
    return any(isinstance(node, ast.BinOp) for node in ast.walk(method))


def describe(path: Path, text: bytes, error: BaseException) -> str:
    """Describe an error in a user's file, in one line, with the line of the file.

    Parameters
    ----------
    path : Path
    text : bytes
        What the file contains.
    error : BaseException
        From running it.

    Returns
    -------
    str
    """
    line = _line_number(path, text, error)
    place = f"{path}, line {line}" if line else str(path)
    told = re.sub(rf"\b{re.escape(path.stem)}_[0-9a-f]{{12}}\.", "", _description(error))
    return f"{place}: {' '.join(told.split())}"


def line_of(text: bytes, owner: str, variable: str = "") -> int | None:
    """Return the line on which a class, or a variable in it, is declared.

    Parameters
    ----------
    text : bytes
        Of a file that Python can read.
    owner : str
        Name of the class.
    variable : str

    Returns
    -------
    int or None
        The class's where the variable has none of its own; None without the class.
    """
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ClassDef) and node.name == owner:
            lines = {name: line for name, line, _ in _named(node)}
            return lines.get(variable, node.lineno)
    return None


def _line_number(path: Path, text: bytes, error: BaseException) -> int | None:
    if isinstance(error, SyntaxError):
        return error.lineno
    if isinstance(error, DeclarationError):
        own = line_of(text, error.owner, error.variable)
        if own:
            return own
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f.lineno for f in frames if Path(f.filename).absolute() == path.absolute()]
    return lines[-1] if lines else None


def _description(error: BaseException) -> str:
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg}"
    if isinstance(error, UserError) and str(error):
        return str(error)
    found = _UNKNOWN_ARGUMENT.search(str(error))
    if found:
        known = Declaration.__dataclass_fields__
        return f"{found[1]} takes no argument {found[2]!r}{suggestion(found[2], known)}"
    if isinstance(error, NameError) and error.name in _kit():
        return f"{error.name} is not there; write: from fmus.kit import {error.name}"
    return ": ".join(filter(None, (type(error).__name__, str(error))))


def _kit() -> list[str]:
    import fmus.kit

    return fmus.kit.__all__
