"""Options of a diagnosis: what is known of the model, what may be searched, and for how long."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import process_time

from fmus.kit import Component, Effect, UserError, stack
from fmus.kit.effects import effect_name
from fmus.kit.errors import suggestion
from fmus.kit.interrupt import Interrupt, deferred
from fmus.kit.registry import Excitation
from fmus.kit.symbolic import check_component
from orchestration.diagnosis.catalogue import usable_effects, usable_of
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.terms import NamedTerm, SensorTerm, Term
from orchestration.fmu.model import find_effects, known_effects, names_class
from orchestration.reporting import option

_FAMILIES = "families"  # which terms over all laws and signals are, without any name


@dataclass(frozen=True)
class Options:
    """Options of a diagnosis.

    Attributes
    ----------
    hold : collection of str
        Parameters that keep their values, and inputs that an experiment cannot set.
    fit : collection of str
        Parameters that are fitted, all others being held; empty for all.
    each : collection of str
        Parameters with a value of their own in every record.
    given : Mapping of str to float
        Nominal values of parameters, and values of inputs that are constant, SI.
    effects : sequence of str or None
        Names or ids of the effects that may be causes, or ``path/to/file.py:Class``; by default
        all of the catalogue.
    catalogue : Mapping of str to type[Effect] or None
        The effects of the catalogue by name; by default those that the model's authors list.
    laws : bool
        Whether terms of the laws may be causes, beside effects and faults of sensors and files.
    thorough : bool
        Whether to search for more than what is plain; see `search`.
    interpolate : bool or None
        Whether inputs go in straight lines between samples, or are held; estimated by default.
    time : float or None
        Processor time of the search, s; by default without a limit.
    excitation : Excitation or None
        Limits of an experiment that is designed; without them those that the model declares, and
        where it declares none those of the record, in which an input that stands still stays.
    """

    hold: Collection[str] = ()
    fit: Collection[str] = ()
    each: Collection[str] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    effects: Sequence[str] | None = None
    catalogue: Mapping[str, type[Effect]] | None = None
    laws: bool = True
    thorough: bool = True
    interpolate: bool | None = None
    time: float | None = None
    excitation: Excitation | None = None

    @property
    def recalibrates(self) -> bool:
        """True if nothing but parameters is fitted."""
        return not self.laws and self.effects is not None and not self.effects

    def held(self, parameters: Collection[str], inputs: Collection[str] = ()) -> frozenset[str]:
        """Return the parameters that keep their values.

        Parameters
        ----------
        parameters, inputs : collection of str
            Of the model; inputs only where an experiment may be designed.

        Raises
        ------
        UserError
            If one is unknown, or both held and fitted.
        """
        for name, values in (("hold", self.hold), ("fit", self.fit), ("each", self.each)):
            known = [*parameters, *inputs] if name == "hold" else parameters
            unknown = next((value for value in values if value not in known), None)
            if unknown is not None:
                hint = suggestion(unknown, known)
                raise UserError(f"{option(name, [unknown])}: no parameter named {unknown!r}{hint}")
        both = next((name for name in self.fit if name in self.hold), None)
        if both is not None:
            raise UserError(f"{option('fit', [both])}: {both} is held by {option('hold', [both])}")
        others = [name for name in parameters if self.fit and name not in self.fit]
        return frozenset([*self.hold, *others]).intersection(parameters)

    def held_of(self, model: LawModel) -> frozenset[str]:
        """Return `held`, with what is declared as not fitted unless its fit is asked for."""
        unfitted = {p.name for p in model.parameters if not p.fitted}
        inputs = [v.name for v in model.recorded]
        held = self.held([p.name for p in model.parameters], inputs)
        return held | unfitted.difference(self.fit)

    def own_of_each(self, model: LawModel) -> tuple[str, ...]:
        """Return the parameters with a value of their own in every record, but for start states.

        Raises
        ------
        UserError
            If one is unknown, or not fitted.
        """
        held = self.held_of(model) | model.periods | set(model.shifts)
        real = {p.name for p in model.parameters if p.type == "real"}
        for name in self.each:
            if name not in real or name in held:
                raise UserError(
                    f"{option('each', [name])}: {name} is not fitted, so it cannot differ from"
                    " record to record"
                )
        starts = {model.parameters[i].name for i in model.start_positions}
        return tuple(name for name in dict.fromkeys(self.each) if name not in starts)

    def is_candidate(self, term: Term) -> bool:
        """Return whether a term may be a cause."""
        return self.laws or isinstance(term, NamedTerm | SensorTerm)

    def effects_of(self, cls: type[Component]) -> dict[str, type[Effect]]:
        """Return the effects that may be causes by name: all of the catalogue, or those wanted.

        Faults of sensors may be causes in any case.

        Raises
        ------
        UserError
            If one is unknown, or none that a free run can have.
        """
        listed = self.catalogue
        usable = usable_effects(cls) if listed is None else usable_of(cls, listed)
        if self.effects is None or _FAMILIES in self.effects:
            return usable
        chosen: dict[str, type[Effect]] = {}
        for wanted in self.effects:
            named = {n: e for n, e in usable.items() if wanted in (n, e.id)}
            if not named:
                effect = _known_effect(cls, wanted)
                named = usable_of(cls, {effect_name(effect): effect})
                if not (named or effect.output):
                    raise UserError(
                        f"{option('effects', [wanted])}: {wanted!r} is random, has discrete states,"
                        " or is in the model already, and cannot be judged by a simulation"
                    )
            chosen |= named
        return chosen


def _known_effect(cls: type[Component], wanted: str) -> type[Effect]:
    """Return an effect by its name or its place ``path/to/file.py:Class``.

    Raises
    ------
    UserError
        If there is none, or it cannot be laid over the component.
    """
    if names_class(wanted):
        (effect,) = find_effects(cls, [wanted], cls.name)
        check_component(stack(cls, effect))
        return effect
    known = known_effects(cls, inputs=True)
    if wanted not in known:
        raise UserError(
            f"{option('effects', [wanted])}: no effect named"
            f" {wanted!r}{suggestion(wanted, sorted(known))}"
        )
    return known[wanted]


class Deadline:
    """The end of some processor time of this process, all its threads together, or Ctrl-C.

    Parameters
    ----------
    seconds : float or None
        From now on; None for no end.

    Attributes
    ----------
    was_met : bool
        Whether it never was asked for after its end.
    """

    def __init__(self, seconds: float | None):
        self._end = float("inf") if seconds is None else process_time() + seconds
        self.was_met = True
        self._interrupt = Interrupt()

    @property
    def interrupted(self) -> bool:
        """True if Ctrl-C was pressed where it is taken for the end."""
        return self._interrupt.pressed

    @contextmanager
    def ended_by_ctrl_c(self) -> Iterator[None]:
        """Take the first Ctrl-C in this context for the end; the second one interrupts."""
        if self.interrupted:
            yield
            return
        with deferred() as self._interrupt:
            yield

    def is_over(self) -> bool:
        """Return whether the time is over; work that is still to be done is then left out."""
        over = self.interrupted or process_time() > self._end
        self.was_met &= not over
        return over
