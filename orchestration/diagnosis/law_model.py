"""A model whose laws can be changed by terms, compiled once for all of them."""

from __future__ import annotations

import ctypes
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit import Component, Effect, stack
from fmus.kit.arrays import Array, Indices, Mask
from fmus.kit.build import cached_library, load_library
from fmus.kit.build.toolchain import host_platform
from fmus.kit.declare import InputDeclaration
from fmus.kit.effects import unstack
from fmus.kit.interrupt import uninterrupted
from fmus.kit.layout import takes_arguments
from fmus.kit.record import Rhythm
from fmus.kit.symbolic import PerturbedLaws, trace
from orchestration.diagnosis.delays import (
    has_delays,
    linearise_late,
    linearise_recorded,
    recorded,
    run_late,
)
from orchestration.diagnosis.runs import Course, Linearisation, Record, Setting
from orchestration.diagnosis.terms import NamedTerm, Term, TermStructure, effects_in

_ENGINE = Path(__file__).with_name("free_run.c")
_ARRAY = ctypes.c_void_p
_PRODUCT = """
#define PRODUCT const double *restrict f, const double *restrict s, double *restrict out, int n
typedef void (*row)(PRODUCT);
"""
_HEADERS = "#include <math.h>\n#include <stdlib.h>\n#include <string.h>\n"  # not attributed
_VECTORS = '#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)'
_NOTHING = np.empty(0)
# Largest product of a step and a rate constant: 2.8 is where the method becomes unstable.
_STEP = 0.7
_LONG_STEP = 1.4  # the same of modes that decay within a small part of the time between samples
_STEADY = 2.4  # the same, up to which a parameter may go that no output shows
_MOST_STEPS = 100  # between two samples
_MANY = 20  # from which on these are looked after
# The same for the states of effects: faster ones no record tells from others that follow at once.
_MOST_OF_EFFECTS = 12
_PARAMETERS = 3  # argument of the functions of `PerturbedLaws`
MOST_TICKS = 1000.0  # of all clocks between two samples, on the average


class _Run(ctypes.Structure):
    """A run as ``free_run.c`` reads it."""

    _fields_ = (
        *((n, ctypes.c_int) for n in ("n", "substeps", "free", "terms", "constants", "sensitive")),
        *((n, ctypes.c_int) for n in ("measured", "starts")),
        *((n, _ARRAY) for n in ("time", "inputs", "parameters", "values", "start", "tick_time")),
        *((n, _ARRAY) for n in ("smooth", "position", "tick_clock", "tick", "output", "state")),
        ("shifts", _ARRAY),
        ("term", ctypes.POINTER(TermStructure)),
        *((n, _ARRAY) for n in ("observed", "gain", "bends", "outputs", "slopes", "states")),
    )


class LawModel:
    """A component compiled for free runs with additions to its laws.

    Parameters
    ----------
    cls : type[Component]
    effects : Mapping of str to type[Effect]
        That a named term may lay over it, by name.

    Attributes
    ----------
    laws : list of str
        All that its rates and outputs call.
    signals : list of str
        Inputs, states, laws and ``time``, in the order of ``free_run.c``.
    inputs, states, outputs, parameters : tuple
        Declarations; discrete states are the last of the states.
    rates : list of str
        Laws that are the rate of a state or, of a discrete one, its next value.
    clocks : list of Clock
        Of the discrete states.
    periods : set of str
        Parameters that are periods of clocks, by which a run has no derivatives.
    shifts : dict of str to float or str
        Parameters that shift a clock, each with its period or the parameter for it.
    begins_as_declared : bool
        Whether each run begins at the declared start states, which are known.
    """

    begins_as_declared = False

    def __init__(self, cls: type[Component], effects: Mapping[str, type[Effect]] | None = None):
        layout = cls.layout
        self.cls = cls
        self.perturbed = PerturbedLaws(cls, with_shown_states=True)
        self.inputs, self.states = layout.inputs, (*layout.states, *layout.discretes)
        self.rates = [*(s.rate for s in layout.states), *(z.update for z in layout.discretes)]
        self.outputs = (*layout.outputs, *self.perturbed.shown)
        self.parameters = layout.parameters
        self.laws = self.perturbed.names
        own = [v.name for v in (*self.inputs, *self.states)]
        self.signals = [*own, *self.laws, "time"]
        index = layout.parameter_index
        self.start_positions = [index[layout.start_of[s.name]] for s in self.states]
        self.effects = dict(effects or {})
        self.clocks = [clock for clock, _ in layout.sampled]
        self.shifts = {name: clock.period for clock in self.clocks for name in clock.shift}
        self.periods = layout.clock_parameters - set(self.shifts)
        self._stacked: dict[tuple[str, ...], StackedModel] = {}
        self._locks: defaultdict[tuple[str, ...], Lock] = defaultdict(Lock)
        functions = self.perturbed.functions()
        self._library = self._compiled(functions)
        self._by_parameters, self._moving = self._dependence(functions)

    def __reduce__(self) -> Any:
        """Return what copies and pickles have: graphs and compiled code are made again of it."""
        return type(self), (self.cls, self.effects)

    def stacked(self, effects: tuple[str, ...]) -> StackedModel:
        """Return the model with effects laid over it, compiled when they are first asked for."""
        with self._locks[effects]:
            if effects not in self._stacked:
                cls = stack(self.cls, *(self.effects[name] for name in effects))
                self._stacked[effects] = StackedModel(self, LawModel(cls))
        return self._stacked[effects]

    def _dependence(self, functions: Sequence[ca.Function]) -> tuple[Mask, Mask]:
        """Return which outputs, then laws, depend on parameters at once, and what moves states."""
        of = {f.name(): ca.DM(f.jac_sparsity(0, _PARAMETERS), 1).full() > 0 for f in functions}
        at_once = np.vstack([of.pop("outputs_of"), of.pop("laws_of")])
        moving = [f.any(axis=0) for f in of.values()]
        shifting = np.array([p.name in self.shifts for p in self.parameters], dtype=bool)
        return at_once, np.asarray(np.any([*moving, shifting], axis=0))

    def _compiled(self, functions: Sequence[ca.Function]) -> ctypes.CDLL:
        """Compile the model's functions and the engine as one library."""
        sizes: dict[str, object] = {
            "NX": len(self.states),
            "NU": len(self.inputs),
            "NY": len(self.outputs),
            "NP": len(self.parameters),
            "NL": len(self.laws),
            "LAWS_IW": max(f.sz_iw() for f in functions),
            "LAWS_W": max(f.sz_w() for f in functions),
        }
        generator = ca.CodeGenerator("model.c", {"with_header": False, "casadi_int": "int"})
        for function in functions:
            generator.add(function)
        updates = [f.name() for f in functions if f.name().startswith("update")]
        sizes["UPDATES"] = ", ".join(updates) or 0
        sizes["UPDATE_SLOPES"] = ", ".join(f"DERIVATIVES({name})" for name in updates) or "{{0}}"
        head = "\n".join(f"#define {name} {value}" for name, value in sizes.items())
        rows = "\n".join(_rows_of(f) for f in functions if f.n_out() > 1)
        export = "#define CASADI_SYMBOL_EXPORT static"
        text = "\n".join([export, generator.dump(), head, _PRODUCT, rows, _ENGINE.read_text()])
        sources = {"model.c": with_vectors(text).encode()}
        library = load_library(cached_library(sources, "model.c", host_platform()))
        for name in ("free_run", "linearise", "steps"):
            getattr(library, name).restype = ctypes.c_int
        library.shapes.restype = None
        return library

    def run(
        self, record: Record, setting: Setting, start: Array, *, sensitive: bool = False
    ) -> Course | None:
        """Run freely over a record from start states (nx,), SI.

        None if it leaves all bounds, or has more ticks than `MOST_TICKS`.
        """
        if record.is_recorded_otherwise:
            course = self.run(record.plain, setting, start, sensitive=sensitive)
            return None if course is None else recorded(course, record)
        if has_delays(setting):
            return run_late(self, record, setting, start, sensitive=sensitive)
        effects = effects_in(setting.terms)
        if effects:
            return self.stacked(effects).run(record, setting, start, sensitive=sensitive)
        if self.ticks_in_step(record, setting.parameters) > MOST_TICKS:
            return None
        return self._run(record, setting, start, sensitive=sensitive)

    def _run(
        self, record: Record, setting: Setting, start: Array, *, sensitive: bool
    ) -> Course | None:
        """Run with terms of laws, with slopes by those parameters that act."""
        n, measured = len(record.time), record.measured
        acting = self._acting(setting, measured)
        starts = len(self.states) if setting.searched is None else len(setting.searched)
        columns = np.append(acting, np.ones(len(setting.values) + starts, dtype=bool))
        outputs = np.empty((n, len(self.outputs)))
        own = np.empty((n, int(measured.sum()), int(columns.sum())) if sensitive else (0, 0, 0))
        states = np.empty((n, len(self.states) + setting.memories))
        plain = replace(setting, free=setting.free[acting])
        with self._given(record, plain, measured, start, (outputs, own, states)) as run:
            run.sensitive = int(sensitive)
            failed = self._library.free_run(ctypes.byref(run))
        if failed or not np.isfinite(own).all():
            return None
        if not sensitive or columns.all():
            return Course(outputs, own, states)
        slopes = np.zeros((*own.shape[:2], len(columns)))
        slopes[:, :, columns] = own
        return Course(outputs, slopes, states)

    def _acting(self, setting: Setting, measured: Mask) -> Mask:
        """Return the free parameters (p,) on which measured outputs (ny,) can depend at all."""
        looked_at = {s for term in setting.terms for s in (term.signal, term.factor)}
        laws = np.array([law in looked_at for law in self.laws], dtype=bool)
        acting = self._by_parameters[np.concatenate([measured, laws])].any(axis=0)
        return np.asarray((acting | self._moving)[setting.free])

    def linearise(self, record: Record, setting: Setting, course: Course) -> Linearisation:
        """Linearise along a course."""
        if record.is_recorded_otherwise:
            return linearise_recorded(course, self.linearise(record.plain, setting, course))
        if has_delays(setting):
            return linearise_late(self, record, setting, course)
        effects = effects_in(setting.terms)
        if effects:
            return self.stacked(effects).linearise(record, setting, course)
        n, ny, nl = len(record.time), len(self.outputs), len(self.laws)
        nx = len(self.states) + setting.memories
        states = np.ascontiguousarray(course.states)
        assert states.shape == (n, nx), "the course is of other terms"
        columns = len(setting.free) + len(setting.values) + nx
        rates, outputs = np.zeros((n, nx, columns)), np.zeros((n, ny, columns))
        by_laws = np.zeros((n, nl, len(self.states))), np.zeros((n, nl, ny))
        laws = np.empty((n, nl))
        with self._given(record, setting) as run:
            results = (states, rates, outputs, *by_laws, laws)
            self._library.linearise(ctypes.byref(run), *map(_pointer, results))
            by_law, output_by_law = (a.swapaxes(1, 2) for a in by_laws)
            part = Linearisation(
                rates, outputs, by_law, output_by_law, laws, gains=record.gains(setting.memories)
            )
            return self._with_steps(part, run, states) if self.clocks else part

    def _with_steps(self, part: Linearisation, run: _Run, states: Array) -> Linearisation:
        """Return a linearisation with the derivatives of the steps between samples."""
        n, nx, columns = part.rates.shape
        nl = len(self.laws)
        steps = np.empty((n - 1, nx, columns + nl))
        self._library.steps(ctypes.byref(run), _pointer(states), _pointer(steps))
        own, by_law, by_state = np.split(steps, [columns - nx, columns - nx + nl], axis=2)
        return replace(part, steps=np.dstack([own, by_state]), steps_by_laws=by_law)

    @contextmanager
    def _given(
        self,
        record: Record,
        setting: Setting,
        measured: Mask | None = None,
        start: Array = _NOTHING,
        results: Sequence[Array] = (_NOTHING,) * 3,
    ) -> Iterator[_Run]:
        """Give a run as the library reads it, as long as its arrays live."""
        ticks = record.ticks(self._rhythms(setting.parameters))
        searched = range(len(self.states)) if setting.searched is None else setting.searched
        shown = range(len(self.outputs)) if measured is None else np.flatnonzero(measured)
        own = (setting.parameters, setting.values, start, ticks.time)
        shifts = [[self.parameters[i].name in c.shift for i in setting.free] for c in self.clocks]
        positions = (setting.free, ticks.clock, ticks.first, shown, searched, shifts)
        doubles = [np.ascontiguousarray(a, dtype=float) for a in own]
        integers = [np.ascontiguousarray(a, dtype=np.int32) for a in (record.smooth, *positions)]
        seen = (None, None) if record.gain is None else (record.outputs, record.gain)
        structures = [term.structure(self.laws, self.signals) for term in setting.terms]
        array = (TermStructure * max(1, len(structures)))(*structures)
        counts = (setting.substeps, len(setting.free), len(structures), len(setting.values), 0)
        yield _Run(
            len(record.time),
            *counts,
            len(shown),
            len(searched),
            *map(_address, (record.time, record.inputs, *doubles)),
            *map(_address, integers),
            array,
            *(None if a is None else _address(a) for a in (*seen, record.bends)),
            *map(_address, results),
        )
        del doubles, integers, array

    def ticks_in_step(self, record: Record, parameters: Array) -> float:
        """Return the ticks of all clocks between two samples of a record, on the average."""
        step = float(np.ptp(record.time)) / max(1, len(record.time) - 1)
        return sum(step / period for _, period in self._rhythms(parameters))

    def _rhythms(self, parameters: Array) -> tuple[Rhythm, ...]:
        """Return the rhythm of each clock."""
        if not self.clocks:
            return ()
        index = self.cls.layout.parameter_index
        return tuple(
            (
                float(sum(parameters[index[name]] for name in clock.shift)),
                float(
                    parameters[index[clock.period]]
                    if isinstance(clock.period, str)
                    else clock.period
                ),
            )
            for clock in self.clocks
        )

    def shape_values(self, term: Term, signal: Array) -> Array:
        """Return the shape functions (n, coefficients) of a term at values (n,) of its signal."""
        structure = term.structure(self.laws, self.signals)
        out = np.empty((len(signal), term.coefficients))
        signal = np.ascontiguousarray(signal)
        self._library.shapes(
            ctypes.byref(structure),
            len(signal),
            _pointer(signal),
            ctypes.c_double(np.log(term.width)),
            _pointer(out),
        )
        return out

    def substeps(self, record: Record, setting: Setting, course: Course) -> int:
        """Return the steps between two samples that its fastest rate asks for along a course."""
        if not self.states:
            return 1
        step = max(1, len(record.time) // 20)
        thin = Course(course.outputs, course.slopes, course.states[::step])
        slopes = self.linearise(record.part(0, len(record.time), step), setting, thin).rates
        return steps_of(slopes, record)

    def is_steady(self, record: Record, setting: Setting, start: Array) -> bool:
        """Return whether steps are clearly shorter than where the method is unstable, at a start.

        Of a setting without terms. Few steps are taken to be.
        """
        if setting.substeps < _MANY or len(record.time) < 2:
            return True
        none = np.zeros((0, 0, 0))
        first = Course(np.zeros((1, len(self.outputs))), none, start[np.newaxis])
        rates = self.linearise(record.first, setting, first).rates
        fastest = np.abs(_eigenvalues(rates)).max(initial=0.0)
        return bool(np.diff(record.time).max() * fastest < _STEADY * setting.substeps)

    @property
    def recorded(self) -> tuple[InputDeclaration, ...]:
        """Inputs that a file may have."""
        return tuple(self.inputs)

    def simulated(self, record: Record) -> Record:
        """Return a record with inputs that follow from those that were recorded."""
        return record

    def linearise_at(self, parameters: Array) -> bool:
        """Take parameters (np,) as a place at which the model is exact; whether it was none yet."""
        return False

    @property
    def received(self) -> frozenset[str]:
        """Laws of inputs as they arrive; another function of one is like a misread file."""
        return frozenset()

    @property
    def is_dynamic(self) -> bool:
        """True if an output depends on what inputs were before."""
        return bool(self.states)

    @cached_property
    def targets(self) -> list[str]:
        """Laws that may lack a term.

        No outputs, no definitions, no count of an input, and no memory of an effect.
        """
        left_out = {o.name for o in self.outputs} | self._memory
        laws = self.perturbed
        return [
            law
            for law in self.laws
            if law not in left_out and not laws.is_definition(law) and not laws.is_count(law)
        ]

    @cached_property
    def _memory(self) -> set[str]:
        """States of sensors and other memory of effects, and the laws by which they move."""
        _, effects = unstack(self.cls)
        layouts = [effect.layout for effect in effects if effect.output]
        sensors = {s.name for own in layouts for s in (*own.states, *own.discretes)}
        memory = {z.name for z in self.cls.layout.discretes if z.is_memory}
        pairs = zip(self.states, self.rates, strict=True)
        return {name for s, law in pairs if s.name in sensors | memory for name in (s.name, law)}

    @cached_property
    def arguments(self) -> frozenset[str]:
        """Signals that a term may be a function of.

        Neither the law of an output nor the rate of a state, which follows from the others, nor a
        law that is a function of one of them, or has arguments, which only its callers know, nor
        the memory of an effect. A state that is an output is still a state.
        """
        states = {s.name for s in self.states}
        left_out = {o.name for o in self.cls.layout.outputs} | set(self.followed)
        left_out |= {law for law in self.laws if len(self.perturbed.computed_from(law)) < 2}
        left_out |= {law for law in self.laws if takes_arguments(self.cls, law)}
        return frozenset(self.signals) - (left_out - states) - self._memory

    @cached_property
    def plain_laws(self) -> frozenset[str]:
        """Laws that are as plain a signal of another as a state."""
        return frozenset()

    def depends_on(self, law: str) -> set[str]:
        """Return the inputs and states of which a law is a function already."""
        return set(self.perturbed.computed_from(law))

    def reads(self, law: str) -> set[str]:
        """Return the signals of which a law is a function already, and the laws that it calls.

        An effect may add to an input, which calls none.
        """
        return self.depends_on(law) | self._called.get(law, set())

    @cached_property
    def _called(self) -> dict[str, set[str]]:
        """The laws that each law calls."""
        reads = self.perturbed.reads_itself
        return {law: {other for other in self.laws if reads(law, other)} for law in self.laws}

    @cached_property
    def followed(self) -> list[str]:
        """Rates that follow from the signals: not the sample of another signal that is kept."""
        samples = {
            z.update
            for z in self.cls.layout.discretes
            if z.name not in self.perturbed.computed_from(z.update)
        }
        return [law for law in self.rates if law not in samples]

    @cached_property
    def integrals(self) -> frozenset[str]:
        """States that are integrals of another signal: their changes are a lag of that."""
        laws = self.perturbed
        pairs = zip(self.states, self.rates, strict=True)
        return frozenset(s.name for s, r in pairs if laws.is_definition(r) or laws.is_count(r))

    @cached_property
    @uninterrupted()
    def measured_states(self) -> dict[int, int]:
        """Positions of states that an output shows as they are, but for effects of its sensor."""
        names = {s.name: i for i, s in enumerate(self.states)}
        shown = enumerate(ca.vertsplit(trace(unstack(self.cls)[0]).outputs))
        symbols = [(j, e.name()) for j, e in shown if e.is_symbolic()]
        symbols += enumerate((s.name for s in self.perturbed.shown), len(self.cls.layout.outputs))
        return {names[name]: j for j, name in symbols if name in names}

    @cached_property
    def nominal_states(self) -> Array:
        """Typical magnitudes of the states, SI."""
        return np.array([abs(s.nominal) for s in self.states], dtype=float)


class StackedModel:
    """A model with effects of its catalogue, for settings with named terms.

    The parameters of the effects are values of named terms. Their states begin where they are
    declared, in equilibrium, and are not searched.

    Parameters
    ----------
    base : LawModel
    stacked : LawModel
        Compiled with the effects.
    """

    def __init__(self, base: LawModel, stacked: LawModel):
        self.base = base
        self.stacked = stacked
        place = {p.name: i for i, p in enumerate(stacked.parameters)}
        self._place = place
        self._parameters = [place[p.name] for p in base.parameters]
        names = [s.name for s in stacked.states]
        own = [names.index(s.name) for s in base.states]
        self._own = own
        self._added = [i for i in range(len(names)) if i not in own]
        self._known_laws = [i for i, law in enumerate(base.laws) if law in stacked.laws]
        self._laws = [stacked.laws.index(base.laws[i]) for i in self._known_laws]

    def run(
        self, record: Record, setting: Setting, start: Array, *, sensitive: bool
    ) -> Course | None:
        """Run freely; see `LawModel.run`. None also if a term is of a law that an effect removes.

        The states of the effects are the last ones of the course.
        """
        plain = self._setting(record, setting, start)
        if plain is None:
            return None
        record = self._seen(record)
        course = self.stacked.run(record, plain, self._start(plain, start), sensitive=sensitive)
        if course is None:
            return None
        slopes = course.slopes
        if sensitive:
            columns, factors = self._columns(setting, range(len(self._own)))
            slopes = slopes[:, :, columns] * factors
        states = np.ascontiguousarray(course.states[:, self._order(setting)])
        return replace(course, slopes=slopes, states=states)

    def linearise(self, record: Record, setting: Setting, course: Course) -> Linearisation:
        """Linearise along a course of `run`; see `LawModel.linearise`."""
        order = self._order(setting)
        states = np.empty_like(course.states)
        states[:, order] = course.states
        plain = self._setting(record, setting, course.states[0])
        assert plain is not None, "the course is of other terms"
        part = self.stacked.linearise(self._seen(record), plain, replace(course, states=states))
        columns, factors = self._columns(setting, order)
        inner = np.zeros((*part.rates.shape[:2], len(self.stacked.laws)))
        inner[:, : len(self.stacked.states)] = part.rates_by_laws
        found = Linearisation(
            rates=part.rates[:, order][:, :, columns] * factors,
            outputs=part.outputs[:, :, columns] * factors,
            rates_by_laws=self._by_base_laws(inner[:, order]),
            outputs_by_laws=self._by_base_laws(part.outputs_by_laws),
            laws=self._by_base_laws(part.laws),
            gains=None if part.gains is None else part.gains[:, order],
        )
        if part.steps is None or part.steps_by_laws is None:
            return found
        return replace(
            found,
            steps=part.steps[:, order][:, :, columns] * factors,
            steps_by_laws=self._by_base_laws(part.steps_by_laws[:, order]),
        )

    def _by_base_laws(self, columns: Array) -> Array:
        """Return columns (..., nl) of the laws of the base; 0 of one that an effect removes."""
        found = np.zeros((*columns.shape[:-1], len(self.base.laws)))
        found[..., self._known_laws] = columns[..., self._laws]
        return found

    def _setting(self, record: Record, setting: Setting, start: Array) -> Setting | None:
        """Return a setting of the stacked model, whose effects have values of the named terms."""
        parameters = np.array([float(p.start) for p in self.stacked.parameters])
        parameters[self._parameters] = setting.parameters
        free = [self._parameters[i] for i in setting.free]
        terms, values = [], []
        for term, own in setting.by_term():
            if isinstance(term, NamedTerm):
                for one, coordinate in zip(term.released, own, strict=True):
                    parameters[self._place[one.name]] = one.value(coordinate)
                    free.append(self._place[one.name])
            elif {term.law, term.signal, term.factor} - {"", *self.stacked.signals}:
                return None
            else:
                terms.append(term)
                values.append(own)
        plain = replace(
            setting,
            parameters=parameters,
            free=np.array(free, dtype=int),
            terms=tuple(terms),
            values=np.concatenate([np.zeros(0), *values]),
            searched=tuple(self._own),
        )
        return replace(plain, substeps=self._substeps(record, plain, start))

    def _substeps(self, record: Record, setting: Setting, start: Array) -> int:
        """Return the steps between two samples that the effects ask for at the start.

        At rest dry friction is steepest.
        """
        if len(record.time) < 2:
            return setting.substeps
        bare = replace(setting, terms=(), values=np.zeros(0), free=setting.free[:0])
        states = self._start(bare, start)[np.newaxis]
        none = np.zeros((0, 0, 0))
        first = Course(np.zeros((1, len(self.base.outputs))), none, states)
        part = self.stacked.linearise(self._seen(record.first), bare, first)
        most = _MOST_OF_EFFECTS if self._added else _MOST_STEPS
        return max(setting.substeps, min(steps_of(part.rates, record), most))

    def _seen(self, record: Record) -> Record:
        """Return a record with the gain for all states; those of effects run freely."""
        if record.gain is None:
            return record
        n, _, ny = record.gain.shape
        gain = np.zeros((n, len(self.stacked.states), ny))
        gain[:, self._own] = record.gain
        return replace(record, gain=gain)

    def _start(self, setting: Setting, start: Array) -> Array:
        """Return the start states: given ones, and declared ones of the effects."""
        stacked = setting.parameters[self.stacked.start_positions].copy()
        stacked[self._own] = start[: len(self._own)]
        return stacked

    def _order(self, setting: Setting) -> list[int]:
        """Return places of the states: of the model, memories of terms, and of the effects."""
        first = len(self.stacked.states)
        memories = sum(term.has_memory for term in setting.terms)
        return [*self._own, *range(first, first + memories), *self._added]

    def _columns(self, setting: Setting, states: Sequence[int]) -> tuple[list[int], Array]:
        """Return the columns of derivatives in the order of the base, and their factors."""
        p = len(setting.free)
        released = sum(len(t.released) for t in setting.terms if isinstance(t, NamedTerm))
        columns, factors = list(range(p)), [1.0] * p
        at_named, at_plain = p, p + released
        for term, own in setting.by_term():
            if isinstance(term, NamedTerm):
                columns += range(at_named, at_named + len(own))
                pairs = zip(term.released, own, strict=True)
                factors += [one.slope(coordinate) for one, coordinate in pairs]
                at_named += len(own)
            else:
                columns += range(at_plain, at_plain + len(own))
                factors += [1.0] * len(own)
                at_plain += len(own)
        columns += [at_plain + i for i in states]
        return columns, np.array(factors + [1.0] * len(states))


def steps_of(rates: Array, record: Record) -> int:
    """Return the steps between two samples for derivatives of rates; see `Linearisation`.

    A mode that decays before it turns needs no more than a stable step, where it is gone long
    before the next sample: what the others see of it is its integral, which is exact.
    """
    modes = np.diff(record.time).max() * _eigenvalues(rates)
    size = np.abs(modes)
    wanted = size / _STEP
    is_gone = (-modes.real > np.abs(modes.imag)) & (wanted > _MANY)
    wanted[is_gone] = np.maximum(size[is_gone] / _LONG_STEP, _MANY)
    return int(np.clip(np.ceil(wanted.max(initial=0.0)), 1, _MOST_STEPS))


def _eigenvalues(rates: Array) -> Array:
    """Return the eigenvalues of the derivatives by states, 1/s; see `Linearisation`."""
    matrices = rates[:, :, rates.shape[2] - rates.shape[1] :]
    finite = matrices[np.isfinite(matrices).all(axis=(1, 2))]
    return np.asarray(np.linalg.eigvals(finite)).ravel()


def with_vectors(source: str) -> str:
    """Return C for a library of this machine alone, whose loops take four numbers at once.

    If it can; the numbers are the same.
    """
    if not _has_avx2():
        return source
    return f"{_HEADERS}{_VECTORS}\n{source}\n#pragma clang attribute pop\n"


def _has_avx2() -> bool:
    """Return whether NumPy has found these instructions on this machine."""
    compiled = import_module("numpy._core._multiarray_umath")
    return bool(getattr(compiled, "__cpu_features__", {}).get("AVX2"))


def _rows_of(function: ca.Function) -> str:
    """Return the rows of the derivatives that a function returns, in C; see ``free_run.c``."""
    name = function.name()
    text = [_products_of(function)]
    for result in range(2, function.n_out()):
        start, columns, order = _sparsity(function, result)
        for kind, numbers in (("start", start), ("column", columns), ("from", order)):
            listed = ", ".join(map(str, numbers.tolist())) or 0
            text.append(f"static const int {name}_{result}_{kind}[] = {{{listed}}};")
    return "\n".join(text)


def _products_of(function: ca.Function) -> str:
    """Return functions in C for rows of the derivatives by states, times their slopes."""
    name = function.name()
    start, columns, order = _sparsity(function, 1)
    text = []
    for i, (first, last) in enumerate(pairwise(start)):
        elements = zip(order[first:last], columns[first:last], strict=True)
        total = "".join(f" + f[{k}] * s[{column} * n + q]" for k, column in elements)
        body = f"for (int q = 0; q < n; q++) out[q] = {total[3:] or 0.0};"
        text.append(f"static void {name}_row_{i}(PRODUCT) {{ {body} }}")
    listed = ", ".join(f"{name}_row_{i}" for i in range(len(start) - 1)) or 0
    return "\n".join([*text, f"static const row {name}_rows[] = {{{listed}}};"])


def _sparsity(function: ca.Function, result: int) -> tuple[Indices, Indices, Indices]:
    """Return where each row of a result begins, and of each element its column and place."""
    sparsity = function.sparsity_out(result)
    rows, columns = np.array(sparsity.row(), dtype=int), np.array(sparsity.get_col(), dtype=int)
    order = np.argsort(rows, kind="stable")
    start = np.searchsorted(rows[order], np.arange(sparsity.size1() + 1))
    return start, columns[order], order


def _address(array: np.ndarray) -> int:
    assert array.flags.c_contiguous
    return array.ctypes.data


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(_address(array))
