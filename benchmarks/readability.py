"""Figures of how dense code is: a thermometer, not a target.

::

    python -m benchmarks.readability fmus orchestration     # or folders of other projects
"""

from __future__ import annotations

import argparse
import ast
import io
import tokenize
from dataclasses import dataclass, fields
from pathlib import Path

_NO_CODE = (
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.COMMENT,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


@dataclass
class Density:
    """Counts over source files, docstrings and comments left out of lines and characters."""

    files: int = 0
    nodes: int = 0
    lines: int = 0
    characters: int = 0
    tuple_assignments: int = 0
    comprehensions: int = 0
    formatter_off: int = 0

    def __add__(self, other: Density) -> Density:
        """Add the counts of two parts."""
        return Density(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


def _docstring_lines(tree: ast.AST) -> set[int]:
    numbers: set[int] = set()
    for node in ast.walk(tree):
        documented = isinstance(
            node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        )
        if documented and ast.get_docstring(node) is not None:
            first = node.body[0]
            numbers.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return numbers


def density(text: str) -> Density:
    """Count one source file.

    Parameters
    ----------
    text : str
        Python source.
    """
    tree = ast.parse(text)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    spans = [(t.start[0], t.end[0]) for t in tokens if t.type not in _NO_CODE]
    code = {number for first, last in spans for number in range(first, last + 1)}
    code -= _docstring_lines(tree)
    source = text.splitlines()
    nodes = list(ast.walk(tree))
    assignments = [node for node in nodes if isinstance(node, ast.Assign)]
    return Density(
        files=1,
        nodes=len(nodes),
        lines=len(code),
        characters=sum(len(source[number - 1].strip()) for number in code),
        tuple_assignments=sum(
            isinstance(a.targets[0], ast.Tuple) and isinstance(a.value, ast.Tuple)
            for a in assignments
        ),
        comprehensions=sum(isinstance(node, _COMPREHENSIONS) for node in nodes),
        formatter_off=text.count("# fmt: " + "skip") + text.count("# fmt: " + "off"),
    )


def main() -> None:
    """Print the figures of every folder."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.readability", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    total = Density()
    for folder in parser.parse_args().folders:
        for path in sorted(folder.rglob("*.py")):
            total += density(path.read_text(encoding="utf-8"))
    thousand = total.lines / 1000
    print(f"{total.files} files, {total.lines:,} lines of code, {total.nodes:,} syntax-tree nodes")
    print(f"{total.characters / total.lines:.1f} characters a line")
    print(f"{total.tuple_assignments / thousand:.1f} tuple assignments in 1,000 lines")
    print(f"{total.comprehensions / thousand:.1f} comprehensions in 1,000 lines")
    print(f"the formatter is off {total.formatter_off} times")


if __name__ == "__main__":
    main()
