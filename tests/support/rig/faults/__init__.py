"""Faults between a client and its rig: a table of kinds, each with what is promised of
it.

A kind is a function that is handed a :class:`~.bench.Bench` and raises `AssertionError` when the
promise is broken; the decorator :func:`~.bench.fault` puts it into the table. More kinds are more
such functions in a module that is named in `MODULES`.
"""

from __future__ import annotations

from importlib import import_module

from .bench import KINDS, Fault

MODULES = (
    "of_ends",
    "of_servers",
    "of_clients",
    "of_links",
    "of_backends",
    "of_operation",
    "of_attacks",
    "of_runs",
)


def table() -> list[Fault]:
    """All kinds, in the order of the documentation."""
    for name in MODULES:
        import_module(f"{__name__}.{name}")
    return KINDS
