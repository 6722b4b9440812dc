"""A component: declared variables and the laws that compute them."""

from __future__ import annotations

import copyreg
import sys
from collections.abc import Callable, Mapping
from functools import partial
from types import ModuleType
from typing import Any, ClassVar

from .declare import ArrayDeclaration, Declaration, Engine, Preset
from .errors import UserError
from .layout import Layout, arrange, check, check_laws, expand, extract
from .ports import PowerPort


class ComponentType(type):
    """The metaclass of components, whose classes can be pickled if their calls are kept.

    Attributes
    ----------
    described : tuple of str
        Attributes that are also set after a class is made.
    """

    described: ClassVar[tuple[str, ...]] = ("__doc__", "remark", "experiment")
    _made: partial[Any]


def call_of(cls: type) -> partial[Any] | None:
    """Return the call that makes a class; None for a class that is defined in a module."""
    call: partial[Any] | None = vars(cls).get("_made")
    return call


def keep_call(module: ModuleType, call: Callable[[], ModuleType]) -> None:
    """Keep the call that makes a module, for its classes in another process."""
    vars(module)["_run_again"] = call


def neighbours_of(module: ModuleType) -> dict[str, ModuleType]:
    """Return the files beside a user's file that it imported, by the names that it has for them."""
    known: dict[str, ModuleType] = vars(module).setdefault("_neighbours", {})
    return known


def _member(run: Callable[[], ModuleType], name: str) -> Any:
    return getattr(run(), name)


def _reduce(cls: Any) -> Any:
    """Return what pickle stores of a class: its name, or the call that makes it or its module."""
    call = call_of(cls)
    if call is not None:
        return call, (), (None, {name: getattr(cls, name) for name in cls.described})
    run = getattr(sys.modules.get(cls.__module__), "_run_again", None)
    return cls.__qualname__ if run is None else (_member, (run, cls.__qualname__))


def enable_pickling(metaclass: type[ComponentType]) -> None:
    """Let pickle reduce the classes of a metaclass.

    Not in a Python FMU: its modules are dropped with it, and `copyreg` would keep them.
    """
    if __name__ == "fmus.kit.component":
        copyreg.pickle(metaclass, _reduce)


enable_pickling(ComponentType)


class Component(metaclass=ComponentType):
    """Base class of every component.

    The class body declares variables; the attributes of an instance are their current values. Laws
    are methods that compute from ``self``; a law that a declaration names takes no arguments. Laws
    use arithmetic and the functions of :mod:`fmus.kit.functions`, and no ``if`` on values, so that
    one source serves floats, NumPy arrays and CasADi symbols.

    Parameters
    ----------
    **values
        Values of parameters and inputs by name, SI; the others have their defaults. States start
        from their ``*_start`` parameters.

    Raises
    ------
    UserError
        If a name is not a parameter or an input.

    Attributes
    ----------
    name : str
        Name of the FMU; empty for abstract bases and effects.
    author, copyright, license : str
        Texts for the FMU's description; empty ones are omitted.
    remark : str
        Differences from its class (effects, fitted values) for the FMU's description and
        documentation, one statement a line.
    tolerance : float
        Declared accuracy of the internal integration: local error per internal step, relative to
        ``nominal + |state|``.
    experiment : tuple of float
        Stop time and communication step in seconds, for the FMU's ``DefaultExperiment``.
    presets : Mapping of str to Preset
        Named sets of parameter values, which the FMU contains.
    engine : Engine or None
        Computes the component in place of laws; None if it has laws.
    limits : Mapping of str to str
        Laws that limit another law, each with the law that it equals below the limit.
    ports : tuple of PowerPort
        Pairs of variables through which it exchanges power with other components.
    begins_anywhere : bool
        Whether its start states say nothing of its own, as those of an identified model, so that a
        comparison estimates them from the record.
    unchecked : tuple of str
        Laws whose units are not checked, because they compute with bare numbers.
    declared : dict of str to Declaration or ArrayDeclaration
        Variables and arrays that this class itself declares, by name.
    layout : Layout
        All variables, inherited ones included.
    time : float
        Simulation time in seconds, for laws that depend on it.
    """

    name: ClassVar[str] = ""
    author: ClassVar[str] = ""
    copyright: ClassVar[str] = ""
    license: ClassVar[str] = ""
    remark: ClassVar[str] = ""
    experiment: ClassVar[tuple[float, float]] = (100.0, 0.1)
    tolerance: ClassVar[float] = 1e-8
    presets: ClassVar[Mapping[str, Preset]] = {}
    engine: ClassVar[Engine | None] = None
    limits: ClassVar[Mapping[str, str]] = {}
    ports: ClassVar[tuple[PowerPort, ...]] = ()
    begins_anywhere: ClassVar[bool] = False
    unchecked: ClassVar[tuple[str, ...]] = ()
    declared: ClassVar[dict[str, Declaration | ArrayDeclaration]] = {}
    layout: ClassVar[Layout]
    time: Any
    _kept: dict[Any, Any] | None = None  # of shared laws, see sharing.py

    def __init_subclass__(cls, **options: Any) -> None:
        """Take the declarations from the class body, and check and arrange all variables."""
        super().__init_subclass__(**options)
        check_laws(cls)
        cls.declared = extract(cls)
        inherited: dict[str, Declaration | ArrayDeclaration] = {}
        for base in reversed(cls.__mro__):
            inherited |= vars(base).get("declared", {})
        # an input that a subclass computes, as a property, is no longer an input
        inherited = {n: v for n, v in inherited.items() if not _is_computed(cls, n)}
        cls.layout = arrange(expand(cls, inherited).values())
        check(cls, cls.layout)

    def __init__(self, **values: Any) -> None:
        layout = self.layout
        known: dict[str, Any] = {v.name: v.start for v in (*layout.parameters, *layout.inputs)}
        known |= {text.name: text.start for text in layout.texts}
        for name in values:
            if name not in known:
                raise UserError(
                    f"{self.name or type(self).__name__}: no parameter or input named {name!r}"
                )
        # setattr, because CPython is slower for an instance whose __dict__ was accessed
        for name, value in (known | values).items():
            setattr(self, name, value)
        self.time = 0.0
        self.start()

    def start(self) -> None:
        """Set every state to its start value."""
        for state, parameter in self.layout.start_of.items():
            setattr(self, state, getattr(self, parameter))

    def laws(self, names: list[str]) -> list[Callable[[], Any]]:
        """Return bound methods by name.

        Parameters
        ----------
        names : list of str

        Returns
        -------
        list of callable
            Functions without arguments; the method of an effect where one overrides it.
        """
        return [getattr(self, name) for name in names]

    def rates(self) -> list[Any]:
        """Return the time derivatives of the states, in layout order."""
        return [law() for law in self.laws([state.rate for state in self.layout.states])]

    def outputs(self) -> list[Any]:
        """Return the values of the outputs, in layout order."""
        return [law() for law in self.laws([output.name for output in self.layout.outputs])]


def _is_computed(cls: type, name: str) -> bool:
    """Return whether a class computes a variable, as a property."""
    return isinstance(getattr(cls, name, None), property)
