"""Terms of a diagnosis as Python source: short classes to read, to change and to lay over a model.

They compute what the terms compute, without what a search needs: amounts and constants are
parameters with fitted values, and memories begin where those of the first record did.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from fmus.kit import Component, UserError
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.layout import takes_arguments
from fmus.kit.titles import capitalised
from orchestration.diagnosis.extension import extended_component, law_term
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.report.curves import own_courses
from orchestration.diagnosis.term_names import sentence, shape_text, term_parameters
from orchestration.diagnosis.terms import FORMS, MEMORIES, DelayTerm, Memory, NamedTerm, Term
from orchestration.reporting import option

_NAMES = (
    *("absolute", "clip", "Discrete", "Effect", "exp", "maximum", "minimum", "Output"),
    *("Parameter", "smooth_table", "sqrt", "State", "tanh", "where"),
)
_UNBOUNDED = 1e9  # nominal values, beyond which a bound is none
_ADDED = "ADDED"  # name of the classes of a file
_NUMBERS_IN_LINE = 6  # of a table
_FILE = """{title!a}

# from fmus.kit import stack
# better = stack({stacked}, defaults=FITTED)
from fmus.kit import {used}
{base_value}
# the model's own parameters as they were fitted to {files!a}, SI
FITTED = {{
{fitted}
}}
{body}
{added}"""
_CLASS = """

class {name}(Effect):
    {doc!a}

    id = {stem!a}
    neutral = {stem!a}
    assumption = {assumption!a}
"""
_RATE = """
    def {stem}_memory_rate(self):
        now = {now}
        return {rate}"""
_PLAY = """
    def {stem}_memory_update(self):
        now = {now}
        way = self.{stem}_way
        return maximum(minimum(self.{stem}_memory, now + way), now - way)"""
_UPDATES = {  # of memories that are followed at sample instants
    Memory.PLAY: _PLAY,
    Memory.BACKLASH: _PLAY,
    Memory.DAHL: """
    def {stem}_before_update(self):
        return {now}

    def {stem}_memory_update(self):
        now = {now}
        moved = now - self.{stem}_before
        share = exp(-absolute(moved) / self.{stem}_way)
        end = where(moved < 0.0, -self.{stem}_way, self.{stem}_way)
        return share * self.{stem}_memory + (1.0 - share) * end""",
}


def effect_source(fitted: Fit, terms: Mapping[str, Term], files: str) -> str:
    """Return the text of a Python file with a class for each term of a fit.

    Parameters
    ----------
    fitted : Fit
    terms : Mapping of str to Term
        Its terms, by name.
    files : str
        Names of the records.

    Raises
    ------
    UserError
        If there is no term, or one that is an effect of a catalogue or of a measurement.
    """
    _check(terms)
    made = extended_component(fitted, terms)
    classes = _classes(fitted, made, terms)
    names = [one.name for one in classes]
    body = "\n".join(line for one in classes for line in one.lines())
    used = [name for name in _NAMES if re.search(rf"\b{name}\b", body)]
    cls = fitted.problem.model.cls
    subjects = "; ".join(one.subject for one in classes)
    base_value, added = "", ""
    if "base_value(" in body:
        base_value = "from fmus.kit.law_terms import base_value\n"
        added = f"\n\n{_ADDED} = ({', '.join(names)},)\n"
    return _FILE.format(
        title=f"{capitalised(subjects)}: what {cls.name} lacks on a record.",
        stacked=", ".join([cls.__name__, *names]),
        used=", ".join(used),
        base_value=base_value,
        files=files,
        fitted="\n".join(_fitted_lines(cls, made)),
        body=body,
        added=added,
    )


def _classes(fitted: Fit, made: type[Component], terms: Mapping[str, Term]) -> list[_Class]:
    """Return the classes of terms, in the order in which they are laid over a model.

    A class sees its law as those before it leave it, and a term sees it without any.
    """
    order = sorted(terms, key=lambda stem: terms[stem].law not in _seen(terms[stem]))
    below: list[Term] = []
    classes = []
    for stem in order:
        term = terms[stem]
        changed = _seen_changed(fitted.problem.model, term, below, terms.values())
        classes.append(_Class(fitted, made, stem, term, changed))
        below.append(term)
    return classes


def _fitted_lines(cls: type[Component], made: type[Component]) -> Iterator[str]:
    """Yield parameters of a model whose default another class has changed."""
    before = {p.name: p.start for p in cls.layout.parameters}
    for parameter in made.layout.parameters:
        if parameter.start != before.get(parameter.name, parameter.start):
            yield f"    {parameter.name!a}: {_number(parameter.start)},"


def _seen(term: Term) -> set[str]:
    """Return the signals of a term, which may be laws."""
    return {term.signal, term.factor} - {""}


def _check(terms: Mapping[str, Term]) -> None:
    """Refuse terms that have a class already."""
    if not terms:
        raise UserError("no law is found to lack anything, so there is no class to write")
    known = next((s for s, t in terms.items() if isinstance(t, NamedTerm | DelayTerm)), None)
    if known is not None:
        raise UserError(
            f"{known} is an effect that has a class already; {option('fmu', 'better.fmu')} writes"
            " the model with it"
        )


def _seen_changed(
    model: LawModel, term: Term, below: Sequence[Term], terms: Collection[Term]
) -> set[str]:
    """Return the laws that a term sees without any terms, and that its class would see with some.

    Its class stands behind those of the terms below it.
    """
    changed = set()
    for name in _seen(term) & set(model.laws):
        laws = {one.law for one in terms}
        if name == term.law:  # called through super(), at its own class
            laws = (laws - {name}) | {one.law for one in below}
        if any(name == law or model.perturbed.calls(name, law) for law in laws):
            changed.add(name)
    return changed


class _Class:
    """The class of a term: its parameters, its memory, and the law.

    Parameters
    ----------
    fitted : Fit
    made : type[Component]
        The model with the terms of the fit, and fitted values as defaults.
    stem : str
        Name of the term.
    term : Term
    changed : set of str
        Laws that it sees without any terms, and that are changed where it stands.
    """

    def __init__(
        self, fitted: Fit, made: type[Component], stem: str, term: Term, changed: set[str]
    ):
        self._changed = changed
        self._fitted = fitted
        self._stem = stem
        self._term = term
        self._model = fitted.problem.model
        self._given = law_term(fitted, stem, term)
        declared = {p.name: p for p in made.layout.parameters}
        names = [one.name for one in term_parameters(self._model.cls, stem, term)]
        self._parameters = [declared[name] for name in names]

    @property
    def name(self) -> str:
        """Its name in the file."""
        return "".join(word.title() for word in self._stem.split("_"))

    @property
    def subject(self) -> str:
        """The term for people."""
        return sentence(self._model.cls, self._term)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the class, with its table before."""
        term = self._term
        yield from self._table_lines()
        yield _CLASS.format(
            name=self.name,
            stem=self._stem,
            doc=f"{capitalised(self.subject)}: {shape_text(term)}.",
            assumption=f"{term.law} does not depend on {term.signal or 'it'} like this",
        )
        if term.places:
            doc = f"how much of its table {term.law} has"
            yield f"    {self._stem} = Parameter(1.0, '1', nominal=1.0, doc={doc!a})"
        else:
            yield from (f"    {one.name} = {_declaration(one)}" for one in self._parameters)
        yield from self._memory_lines()
        yield ""
        yield from self._law_lines()
        if self._given.range:
            yield from self._signal_lines()

    def _table_lines(self) -> Iterator[str]:
        """Yield the constants of a curve."""
        if not self._term.places:
            return
        numbers = [parameter.start for parameter in self._parameters]
        yield ""
        yield f"{self._stem.upper()}_VALUES = ("
        for k in range(0, len(numbers), _NUMBERS_IN_LINE):
            row = ", ".join(map(_number, numbers[k : k + _NUMBERS_IN_LINE]))
            yield f"    {row},"
        yield ")"

    def _law_lines(self) -> Iterator[str]:
        """Yield the law with what is added to it."""
        term = self._term
        arguments = "*arguments" if self._takes_arguments else ""
        yield f"    def {term.law}(self{', ' if arguments else ''}{arguments}):"
        yield f"        below = super().{term.law}({arguments})"
        if term.signal:
            yield f"        x = {self._argument(self._value(term.signal))}"
        if term.places:
            low, *_, high = self._given.places
            step = _number((high - low) / (len(term.places) - 1))
            ends = f"{_number(low)}, {_number(high)}"
            yield f"        knot = 1.0 + (clip(x, {ends}) - {_number(low)}) / {step}"
        formula = FORMS[term.shape].source.format(
            w=f"self.{self._stem}_width",
            s=_number(self._given.scale),
            table=self._stem.upper(),
            end=len(term.places) + 1,
        )
        change = f"self.{self._stem} * {formula}"
        if term.factor == term.law and term.law not in self._changed:
            yield f"        return below * (1.0 + {change})"
        elif term.factor:
            yield f"        return below + {self._value(term.factor)} * {change}"
        else:
            yield f"        return below + {change}"

    def _signal_lines(self) -> Iterator[str]:
        """Yield the signal of a curve as an output, whose range a run tells when it leaves it."""
        low, high = map(_number, self._given.range)
        seen = self._argument(self._plain_value(self._term.signal))
        yield ""
        yield f"    @Output({self._given.signal_unit!a}, min={low}, max={high}, measured=False)"
        yield f"    def {self._stem}_signal(self):"
        yield f'        """{self._term.signal}, identified in this range only."""'
        yield f"        return {seen}"

    @property
    def _takes_arguments(self) -> bool:
        return takes_arguments(self._model.cls, self._term.law)

    def _argument(self, now: str) -> str:
        """Return the signal, which has a value now, or the memory of it, from its origin on."""
        term = self._term
        memory = f"self.{self._stem}_memory"
        if term.memory.is_sampled and not self._given.is_held:
            memory = f"{memory}_update()"
        seen = memory if term.has_memory else now
        if term.memory.is_behind:
            seen = f"{now} - {memory}"
        return f"{seen} - {_number(self._given.middle)}" if self._given.middle else seen

    def _value(self, signal: str) -> str:
        """Return the value of a signal in the law."""
        if signal == self._term.law and signal not in self._changed:
            return "below"
        return self._plain_value(signal)

    def _plain_value(self, signal: str) -> str:
        """Return the value of a signal outside of the law."""
        if signal in self._changed:
            known = f", {self._given.known}" if self._given.known else ""
            has_own = signal == self._term.law and self._takes_arguments
            own = ", arguments=arguments" if has_own else ""
            return f"base_value(self, {signal!a}, {_ADDED}{known}{own})"
        if signal == self._term.law:
            return f"super().{signal}()"
        return f"self.{signal}()" if signal in self._model.laws else f"self.{signal}"

    def _memory_lines(self) -> Iterator[str]:
        """Yield the states of a memory with their rates or updates."""
        term, stem = self._term, self._stem
        if not term.has_memory:
            return
        along = own_courses(self._fitted)
        start = float(along.remembered(term)[0])
        yield self._state_line(f"{stem}_memory", start, f"memory of {term.signal}")
        if term.memory is Memory.DAHL:
            first = float(along.values[term.signal][0])
            yield self._state_line(f"{stem}_before", first, f"{term.signal} at the instant before")
        kind = MEMORIES[term.memory]
        constants = {name: f"self.{stem}_{name}" for name in kind.constants}
        rate = kind.rate.format(memory=f"self.{stem}_memory", **constants)
        methods = _UPDATES.get(term.memory, _RATE)
        yield methods.format(stem=stem, now=self._plain_value(term.signal), rate=rate)

    def _state_line(self, name: str, start: float, doc: str) -> str:
        """Return the declaration of a state, which is discrete where the memory is sampled."""
        kind, moves = "State", f"rate='{name}_rate'"
        if self._given.period:
            kind = "Discrete"
            moves = f"update='{name}_update', period={_number(self._given.period)}"
        about = f"start={_number(start)}, nominal={_number(self._term.scale)}, doc={doc!a}"
        return f"    {name} = {kind}({self._given.signal_unit!a}, {moves}, {about})"


def _declaration(parameter: ParameterDeclaration) -> str:
    """Return a parameter with its value, and the ends of its range that mean something."""
    arguments = [_number(parameter.start), ascii(parameter.unit)]
    for name in ("min", "max"):
        end = getattr(parameter, name)
        if abs(end) < _UNBOUNDED * parameter.nominal:
            arguments.append(f"{name}={_number(end)}")
    arguments += [f"nominal={_number(parameter.nominal)}", f"doc={parameter.doc!a}"]
    return f"Parameter({', '.join(arguments)})"


def _number(value: Any) -> str:
    """Return a number with as many digits as a simulation can tell."""
    return repr(float(f"{float(value):.12g}"))
