"""Claims: a compiled library runs a record, and many cases of it, each as if it were alone; one
engine serves all models of a machine, and fails in the same words as the FMU.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, UserError
from fmus.kit.build import toolchain
from fmus.kit.build.sources import record_model_sources, record_sources
from fmus.kit.record import library as kit_library
from fmus.kit.record.library import RecordLibrary, compiled, compiled_engine
from fmus.kit.symbolic import trace


class Lag(Component):
    """A first-order lag of a held input: x = u + (x0 - u) exp(-t / tau)."""

    name = "lag"
    tau = Parameter(0.7, "s", min=1e-9)
    u = Input("1")
    x = State("1", rate="x_rate", start=0.2)

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def twice(self):
        return 2.0 * self.x


class Chain(Component):
    """Lags one after the other, the last of them sampled; nothing goes in."""

    name = "chain"
    x = State("1", rate="x_rate", start=1.0)
    y = State("1", rate="y_rate", start=0.0)
    z = Discrete("1", update="next_z", period=0.5)

    def x_rate(self):
        return -self.x

    def y_rate(self):
        return self.x - self.y

    def next_z(self):
        return self.y


class Blowing(Component):
    """A state that is infinite after a second."""

    name = "blowing"
    x = State("1", rate="x_rate", start=1.0)

    def x_rate(self):
        return self.x * self.x


TIME = 0.25 * np.arange(21)
NAMES = [p.name for p in Lag.layout.parameters]
LIMITS = {"tolerance": 1e-9, "effort": 1000.0}


def separate(cls):
    return RecordLibrary.from_sources(cls.layout, record_model_sources(trace(cls)))


def whole(cls):
    path = compiled(record_sources(trace(cls)))
    layout = cls.layout
    return RecordLibrary(
        path, path, len(layout.outputs), len(layout.states) + len(layout.discretes)
    )


@pytest.fixture(scope="module", params=[separate, whole])
def library(request):
    return request.param(Lag)


def starting(cls):
    return np.array([float(p.start) for p in cls.layout.parameters])


def run(library, cls, time=TIME, **limits):
    inputs = len(cls.layout.inputs)
    return library.simulate(
        time,
        np.full((len(time), inputs), 1.5),
        np.zeros(inputs),
        starting(cls),
        **LIMITS | limits,
        ladder=None,
    )


def rows(*cases):
    starts = {p.name: float(p.start) for p in Lag.layout.parameters}
    return np.array([[(starts | case)[name] for name in NAMES] for case in cases])


def held(tau=0.7, x_start=0.2, u=1.5):
    return u + (x_start - u) * np.exp(-TIME / tau)


def test_a_record_follows_the_closed_form(library):
    outputs, states, _ = library.simulate(
        TIME, np.full((21, 1), 1.5), np.zeros(1), rows({"x_start": 0.4})[0], **LIMITS, ladder=None
    )
    assert states[:, 0] == pytest.approx(held(x_start=0.4), abs=1e-8)
    np.testing.assert_array_equal(outputs[:, 0], 2.0 * states[:, 0])


CASES = [{}, {"tau": 0.3}, {"x_start": -1.0}]


@pytest.mark.parametrize("levels", [[1.5], [1.5, -0.5, 3.0]], ids=["one input", "one each"])
def test_cases_are_runs_by_themselves(library, levels):
    """Columns are chosen: output 0, then state 0, which is number 1."""
    tables = np.array(levels)[:, np.newaxis, np.newaxis] * np.ones((1, 21, 1))
    courses, done = library.cases(TIME, tables, rows(*CASES), *LIMITS.values(), [1, 0])
    assert done.all()
    assert courses.shape == (3, 21, 2)
    for k, case in enumerate(CASES):
        exact = held(**case, u=levels[k % len(levels)])
        assert courses[k, :, 0] == pytest.approx(exact, abs=1e-8)
        np.testing.assert_array_equal(courses[k, :, 1], 2.0 * courses[k, :, 0])


def test_a_case_that_cannot_be_run_leaves_the_others(library):
    cases = rows({}, {"x_start": np.nan}, {"tau": 0.3})
    courses, done = library.cases(TIME, np.full((1, 21, 1), 1.5), cases, *LIMITS.values(), [1])
    assert done.tolist() == [True, False, True]
    assert courses[2, :, 0] == pytest.approx(held(tau=0.3), abs=1e-8)


def test_what_fails_is_told(library):
    with pytest.raises(UserError, match="'u' is not a finite number at t = 0 s"):
        library.simulate(
            TIME, np.full((21, 1), np.nan), np.zeros(1), rows({})[0], **LIMITS, ladder=None
        )


# --- one engine for all models
# ----------------------------------------------------------------------------------------------


def test_models_of_different_sizes_run_side_by_side():
    lag, chain = separate(Lag), separate(Chain)
    with ThreadPoolExecutor(4) as pool:
        courses = list(pool.map(lambda k: run(*((lag, Lag), (chain, Chain))[k % 2]), range(40)))
    for outputs, states, _ in courses[::2]:
        assert states[:, 0] == pytest.approx(held(), abs=1e-8)
        np.testing.assert_array_equal(outputs[:, 0], 2.0 * states[:, 0])
    y = TIME * np.exp(-TIME)
    sampled = y[2 * ((np.arange(21) - 1).clip(0) // 2)]  # a sample shows after its instant
    for outputs, states, _ in courses[1::2]:
        assert outputs.shape == (21, 0)
        assert states == pytest.approx(np.column_stack([np.exp(-TIME), y, sampled]), abs=1e-8)


@pytest.fixture
def compilations(monkeypatch, tmp_path):
    """Units that are compiled, with a cache that is empty at first."""
    monkeypatch.setenv("PPY_CACHE", str(tmp_path / "cache"))
    units = []
    original = toolchain.compile_library

    def counted(sources, *arguments, **options):
        units.append(sources[0].read_text())
        return original(sources, *arguments, **options)

    monkeypatch.setattr(toolchain, "compile_library", counted)
    return units


@pytest.mark.slow
def test_the_engine_is_compiled_once_whoever_asks(compilations):
    sources = [record_model_sources(trace(cls)) for cls in (Lag, Chain, Blowing)]
    layouts = [Lag.layout, Chain.layout, Blowing.layout]
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(RecordLibrary.from_sources, layouts, sources))
    engines = [unit for unit in compilations if "record.c" in unit]
    assert (len(compilations), len(engines)) == (4, 1)
    separate(Lag)
    assert len(compilations) == 4


@pytest.mark.slow
def test_a_damaged_engine_is_compiled_anew(compilations):
    path = compiled_engine()
    sound = path.read_bytes()
    path.write_bytes(sound[:-1])
    with pytest.raises(UserError, match="was damaged since it was compiled; begin again"):
        kit_library._load_engine(path)
    assert compiled_engine() == path
    assert path.read_bytes() == sound
    assert len(compilations) == 2


# --- what fails
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cls", "options", "message"),
    [
        (Blowing, {"effort": 1e5}, r"^not finite: x at 1 s$"),
        (Lag, {"effort": 0.01}, r"^more than 0\.01 internal steps per sample up to 0\.25 s: with"),
        (Lag, {"time": np.array([0.0, 1.0, 1.0])}, r"^times must increase, but 1 s follows 1 s$"),
    ],
)
@pytest.mark.parametrize("made", [separate, whole])
def test_a_record_that_cannot_be_run_says_why(made, cls, options, message):
    with pytest.raises(UserError, match=message) as told:
        run(made(cls), cls, **options)
    with pytest.raises(UserError) as again:
        run(separate(cls), cls, **options)
    assert str(told.value) == str(again.value)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("outputs", "^the law 'outputs' could not be evaluated$"),
        ("update_0", "^the law 'update' could not be evaluated$"),
        ("rates", "^not finite: x at 0 s$"),
    ],
)
def test_a_law_that_cannot_be_evaluated_is_named(law, message):
    cls = Chain if law == "update_0" else Lag
    sources = record_model_sources(trace(cls))
    sources["laws.c"] = sources["laws.c"].replace(
        f"CASADI_SYMBOL_EXPORT int {law}(".encode(),
        f"static int {law}(const double **arg, double **res, long long *iw, double *w, int mem)"
        f" {{ (void)res; return 1; }}\nCASADI_SYMBOL_EXPORT int unused_{law}(".encode(),
    )
    with pytest.raises(UserError, match=message):
        run(RecordLibrary.from_sources(cls.layout, sources), cls)


def test_a_step_of_too_many_internal_ones_is_given_up():
    library = separate(Lag)
    time = np.array([0.0, 1.0])
    with pytest.raises(UserError, match=r"^more than 1000000 internal steps in one communication"):
        library.simulate(
            time,
            np.ones((2, 1)),
            np.zeros(1),
            rows({"tau": 1e-9})[0],
            tolerance=1e-9,
            effort=1e6,
            ladder=None,
        )


@pytest.mark.parametrize("cls", [Lag, Chain])
def test_as_many_internal_steps_are_made_as_are_allowed(cls):
    """On average; a single step of the record may take no more than all may."""
    library = separate(cls)
    steps = run(library, cls)[2]
    assert run(library, cls, effort=steps / len(TIME))[2] == steps
    with pytest.raises(UserError, match="internal steps per sample up to 5 s"):
        run(library, cls, effort=(steps - 1.0) / len(TIME))
