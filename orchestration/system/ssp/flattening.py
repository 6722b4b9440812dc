"""Descriptions with systems in systems, collected as one system of members.

A member of an inner system is named ``inner.member``; what is connected through a connector of the
inner system is connected directly. Parameter connectors of a system become other names of the
parameters that they are connected to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError, find
from orchestration.system.ssp.junctions import DeclaredConnection, Junction, entries
from orchestration.system.ssp.package import Package
from orchestration.system.ssp.vocabulary import NAMESPACES, attribute, local_name, path_of, tag

_Dictionary = Callable[[], dict[str, Junction]]


class Structure:
    """The elements of a system and of the systems in it, under their full names.

    Attributes
    ----------
    components : dict of str to Element
    connectors : list of Element
        Connectors of the outermost system other than parameters.
    connections : list of DeclaredConnection
    junctions : dict of str to dict of str to Junction
        By element and connector.
    bindings : list of (str, Element)
        Parameter bindings with the name of their component or system; those that come later count.
    """

    def __init__(self, package: Package, enumerations: Mapping[str, Element]):
        self.components: dict[str, Element] = {}
        self.connectors: list[Element] = []
        self.connections: list[DeclaredConnection] = []
        self.junctions: dict[str, dict[str, Junction]] = {}
        self.bindings: list[tuple[str, Element]] = []
        self._package = package
        self._enumerations = enumerations  # by name
        self._aliases: dict[str, list[str]] = {}  # by the full name of a parameter connector

    def add(
        self, system: Element, path: str = "", outer: Mapping[str, _Dictionary] | None = None
    ) -> None:
        """Add what is in a system, and in the systems in it.

        Parameters
        ----------
        system : Element
            A ``System``, or an element of an annotation with connectors of the system.
        path : str
            Its name; empty for the outermost.
        outer : Mapping of str to callable, optional
            Signal dictionaries of the systems around it, as functions that return the entries.

        Raises
        ------
        UserError
            If a name is empty or that of two components, or a signal dictionary or an attribute is
            missing.
        """
        dictionaries = dict(outer or {})
        for element in system.iterfind("ssd:SignalDictionaries/ssd:SignalDictionary", NAMESPACES):
            # read once and only if it is referred to
            read = cache(partial(entries, element, self._package))
            dictionaries[attribute(element, "name")] = read
        self._add_connectors(system, path)
        for element in system.iterfind("ssd:Connections/ssd:Connection", NAMESPACES):
            self._add_connection(DeclaredConnection.of(element, path), path)
        inner = []
        for element in system.iterfind("ssd:Elements/*", NAMESPACES):
            name = path_of(path, attribute(element, "name"))
            if name == path:
                raise UserError(
                    f"{path or 'the system'}: a {local_name(element)} has an empty name"
                )
            if element.tag == tag("ssd:System"):
                inner.append((element, name))
            elif element.tag == tag("ssd:SignalDictionaryReference"):
                where = f"{name}: there is no signal dictionary"
                self.junctions[name] = find(attribute(element, "dictionary"), dictionaries, where)()
            elif name in self.components:
                raise UserError(f"two members have one name, {name!r}")
            else:
                self.components[name] = element
                self._add_bindings(element, name)
        for element, name in inner:
            self.add(element, name, dictionaries)
        self._add_bindings(system, path)

    def parameters(self, name: str) -> list[str]:
        """Return the parameters of members that a name sets, through connectors of systems."""
        if name not in self._aliases:
            return [name]
        return [target for alias in self._aliases[name] for target in self.parameters(alias)]

    def _add_bindings(self, owner: Element, path: str) -> None:
        for binding in owner.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
            self.bindings.append((path, binding))

    def _add_connectors(self, system: Element, path: str) -> None:
        others = []
        for element in system.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
            if element.get("kind") == "parameter":
                self._aliases[path_of(path, attribute(element, "name"))] = []
            else:
                others.append(element)
        if path:
            listed = [Junction(each, self._enumerations) for each in others]
            self.junctions[path] = {junction.name: junction for junction in listed}
        else:
            self.connectors += others

    def _add_connection(self, connection: DeclaredConnection, path: str) -> None:
        """Add a connection, or what a parameter connector of its system sets."""
        ends = (connection.start, connection.end)
        for own, target in (ends, ends[::-1]):
            if own.member == path != target.member and str(own) in self._aliases:
                self._aliases[str(own)].append(str(target))
                return
        self.connections.append(connection)
