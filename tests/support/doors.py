"""Contract for import-linter: a package is entered by its ``__init__``, and by nothing else."""

from __future__ import annotations

import ast
from pathlib import Path

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

ROOT = Path(__file__).parents[2]
ROOTS = ("fmus", "orchestration", "ppy_rig", "demonstrations", "studies")


class Doors(Contract):
    """No module imports a module of a package that it is not in, unless the package offers it.

    A module is in its own package and in those around it. What a package offers is what its
    ``__init__`` imports, in the stub ``__init__.pyi`` where names are loaded when they are used;
    and its public modules, which a package whose ``__init__`` must load nothing cannot import.
    """

    public = fields.SetField(subfield=fields.StringField(), required=False, default=set())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Collect the imports that go past a door."""
        past = sorted(
            (importer, imported)
            for importer in graph.modules
            if importer.partition(".")[0] in ROOTS
            for imported in graph.find_modules_directly_imported_by(importer)
            if imported.partition(".")[0] in ROOTS
            and imported not in self.public
            and not may_import(importer, imported)
        )
        return ContractCheck(kept=not past, metadata={"past": past})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Print every import that goes past a door."""
        for importer, imported in check.metadata["past"]:
            output.print_error(f"{importer} imports {imported}, which its package does not offer")


def may_import(importer: str, imported: str) -> bool:
    """Return True if a module may import another, both given by their dotted names."""
    package, _, name = imported.rpartition(".")
    if _folder(imported).is_dir() or not package:
        return True
    return importer == package or importer.startswith(f"{package}.") or name in offered(package)


def _folder(module: str) -> Path:
    return ROOT / module.replace(".", "/")


def offered(package: str) -> set[str]:
    """Names that a package offers.

    Parameters
    ----------
    package : str
        Its dotted name.
    """
    stub = _folder(package) / "__init__.pyi"
    source = stub if stub.exists() else stub.with_suffix(".py")
    statements = ast.walk(ast.parse(source.read_text(encoding="utf-8")))
    imports = [node for node in statements if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name for node in imports for alias in node.names}
