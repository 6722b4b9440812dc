"""An engine of a component's own, for what no law computes: a rig at the other end of a cable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Engine:
    """What computes a component that has no laws, in both builds.

    Such a component keeps something outside of its memory, so its FMU state cannot be saved.

    Attributes
    ----------
    slave : str
        Class with the methods of :class:`fmus.kit.slave.Slave`, ``module:Class``; called with the component's class,
        its memory and its texts.
    needs : Mapping of str to str
        Packages that it imports at run time, by the name that is imported: what to install.
    folder : str
        Package with the C files of the native build.
    sources : tuple of str
        C files, which implement the engine of ``fmi2/engine.h``.
    headers : tuple of str
    libraries : Mapping of str to tuple of str
        Names for ``-l`` by FMI platform.
    """

    slave: str
    needs: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""
    sources: tuple[str, ...] = ()
    headers: tuple[str, ...] = ()
    libraries: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
