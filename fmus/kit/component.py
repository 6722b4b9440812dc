"""Component: declarations plus laws, evaluated on whatever its attributes hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar
from zlib import crc32

from .declare import Declaration, Preset
from .engine import Engine
from .errors import UserError, suggestion
from .layout import Layout, arrange, check, extract

_LONGEST_NAME = 120  # file systems allow 255 bytes, with a prefix and a suffix of the cache


class Component:
    """Base of every component: the class body declares variables, instance attributes are their current values.

    Laws are methods that compute from ``self``, without arguments where a declaration names them. They are plain
    arithmetic and the functions of :mod:`fmus.kit.functions`; no ``if`` on values, so that one source serves floats,
    NumPy arrays and CasADi symbols.

    Parameters
    ----------
    **values
        Initial values by variable name (SI), replacing defaults. States start from their ``*_start`` parameters.

    Raises
    ------
    UserError
        If a name is not a parameter or an input.

    Attributes
    ----------
    name : str
        Name of the FMU; empty for abstract bases and effects.
    author, copyright, license : str
        For the FMU's description; left out where empty.
    remark : str
        How it differs from its class (effects, fitted values), for the FMU's description and documentation; one
        statement to a line.
    tolerance : float
        Declared accuracy of the internal integration: local error per internal step, relative to
        ``nominal + |state|``.
    experiment : tuple of float
        Stop time and communication step in seconds, for the FMU's ``DefaultExperiment``.
    presets : Mapping of str to Preset
        Named sets of parameter values, which the FMU brings along.
    engine : Engine or None
        What computes it, where that is not its laws.
    declared : dict of str to Declaration
        What this class itself declares, by name.
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
    declared: ClassVar[dict[str, Declaration]] = {}
    layout: ClassVar[Layout]
    time: Any

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.declared = extract(cls)
        inherited: dict[str, Declaration] = {}
        for base in reversed(cls.__mro__):
            inherited |= vars(base).get("declared", {})
        cls.layout = arrange(inherited.values())
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
        # setattr rather than __dict__: an instance whose __dict__ was touched is slower for good in CPython
        for name, value in (known | values).items():
            setattr(self, name, value)
        self.time = 0.0
        self.start()

    def start(self) -> None:
        """Put every state at its start value."""
        for state, parameter in self.layout.start_of.items():
            setattr(self, state, getattr(self, parameter))

    def laws(self, names: list[str]) -> list[Callable[[], Any]]:
        """Bound methods that the declarations name; where an effect overrides one, it is the effect's.

        Parameters
        ----------
        names : list of str

        Returns
        -------
        list of callable
            Without arguments.
        """
        return [getattr(self, name) for name in names]

    def rates(self) -> list[Any]:
        """Time derivatives of the states, in layout order."""
        return [law() for law in self.laws([state.rate for state in self.layout.states])]

    def outputs(self) -> list[Any]:
        """Values of the outputs, in layout order."""
        return [law() for law in self.laws([output.name for output in self.layout.outputs])]


@dataclass(frozen=True)
class Term:
    """What an effect adds to a law.

    Attributes
    ----------
    law, signal, shape : str
        The law it changes, the signal that the change is a function of, and that function.
    family : str
        What effects have in common that are one cause in several shapes: a law over a signal, what it remembers of
        one, the loop that it runs through over one, or an input as it arrives. Empty where there are no others.
    qualifier : str
        What tells it from an effect of the same id: the law, or the input, that it concerns, or its shape.
    """

    law: str = ""
    signal: str = ""
    shape: str = ""
    family: str = ""
    qualifier: str = ""


class Effect(Component):
    """An unmodelled effect of known form: a mixin that overrides one law of a component through ``super()``.

    An effect of the physics overrides laws; an output is for effects of its measurement, which no law sees
    (:mod:`fmus.kit.sensors`).

    Attributes
    ----------
    id : str
        Name in the effect catalogue.
    output : str
        The output whose measurement it concerns; empty for effects of the physics.
    term : Term
        What it adds to which law, where that is told.
    neutral : str
        The parameter that switches it: at the default value the component is exactly the one below.
    assumption : int or str
        What it relaxes: number of an assumption in the component's README, or words.
    """

    id: ClassVar[str] = ""
    output: ClassVar[str] = ""
    term: ClassVar[Term] = Term()
    neutral: ClassVar[str] = ""
    assumption: ClassVar[int | str] = ""


def effect_name(effect: type[Effect]) -> str:
    """Id of an effect, with what it is of where there may be several: ``sensor_lag(voltage)``, ``cubic(drop)``."""
    of = effect.output or effect.term.qualifier
    return f"{effect.id}({of})" if of else effect.id


def by_name(*effects: type[Effect]) -> dict[str, type[Effect]]:
    """Effects by their names, for a catalogue."""
    return {effect_name(effect): effect for effect in effects}


def _label(effect: type[Effect]) -> str:
    of = (effect.output or effect.term.qualifier).replace(", ", "_of_")
    return f"{effect.id}_of_{of}" if of else effect.id


def _joined(parts: list[str]) -> str:
    """Join names into one; a long one ends in a checksum of the whole, because it becomes a file name."""
    name = "_with_".join(parts)
    return (
        name
        if len(name) <= _LONGEST_NAME
        else f"{name[: _LONGEST_NAME - 9]}_{crc32(name.encode()):08x}"
    )


def _owners(cls: type[Component]) -> dict[str, type]:
    """Variables of a class, and by which of its bases each is declared."""
    return {name: part for part in reversed(cls.__mro__) for name in vars(part).get("declared", {})}


def _redeclared(
    prefix: str, parts: tuple[type[Component], ...], defaults: Mapping[str, float | str]
) -> dict[str, Any]:
    """Declare parameters anew with other defaults; the start value of a state is in the state's declaration."""
    holders: dict[str, Any] = {
        p.name: p for part in parts for p in (*part.layout.parameters, *part.layout.texts)
    }
    layouts = [part.layout for part in parts]
    holders |= {
        layout.start_of[s.name]: s
        for layout in layouts
        for s in (*layout.states, *layout.discretes)
    }
    for name in defaults:
        if name not in holders:
            raise UserError(f"{prefix}: no parameter named {name!r}{suggestion(name, holders)}")
    return {
        holders[name].name: replace(holders[name], start=value) for name, value in defaults.items()
    }


def stack(
    base: type[Component],
    *effects: type[Effect],
    name: str | None = None,
    defaults: Mapping[str, float | str] | None = None,
) -> type[Component]:
    """Lay effects over a component; later effects see the laws of earlier ones through ``super()``.

    Parameters
    ----------
    base : type[Component]
        The component class, also one that has effects already.
    *effects : type[Effect]
        Effects, innermost first.
    name : str, optional
        FMU name of the result; default joins the ids, with the output that an effect is of, as far as a file name goes.
    defaults : Mapping of str to float or str, optional
        Values of parameters that replace their defaults, start values too, SI; texts of texts. Those of the base stay
        otherwise.

    Returns
    -------
    type[Component]

    Raises
    ------
    UserError
        If the base has no laws, two effects have the same id and output, two classes declare a variable of the same
        name, or there is no such output, or a default is of no parameter or out of its range.
    """
    prefix, remark = base.name, base.remark
    if effects and base.engine is not None:
        raise UserError(
            f"{prefix} has no laws that an effect could change: it stands for something outside"
        )
    name = name or _joined([prefix, *map(_label, effects)])
    values = {**vars(base).get("stacked_with", {}), **(defaults or {})}
    base, earlier = vars(base).get("stacked", (base, ()))
    effects = (*earlier, *effects)
    ids = [_label(e) for e in effects]
    repeated = [i for i in ids if ids.count(i) > 1]
    if repeated:
        raise UserError(f"{prefix}: effect {repeated[0]!r} is laid over it twice")
    owners = _owners(base)
    for effect in effects:
        for variable, owner in _owners(effect).items():
            other = owners.setdefault(variable, owner)
            if other is not owner:
                raise UserError(
                    f"{prefix}: {other.__name__} and {owner.__name__} both declare variable {variable!r}"
                )
    outputs = {o.name for part in (base, *effects) for o in part.layout.outputs}
    for effect in effects:
        if effect.output and effect.output not in outputs:
            raise UserError(
                f"{prefix}: {effect.id} is of {effect.output!r}, which is none of its outputs"
            )
    title = "".join(e.__name__ for e in reversed(effects)) + base.__name__
    about = {"name": name, "remark": remark, "__doc__": base.__doc__, "__module__": base.__module__}
    made = {"stacked": (base, effects), "stacked_with": values}
    return type(
        title,
        (*reversed(effects), base),
        about | made | _redeclared(prefix, (base, *effects), values),
    )
