"""Claims: a wrapped FMU of FMI 3.0 gives the numbers that the FMU itself gives.

Oracles: fmpy, which calls the FMU without the wrapper, and closed forms.
"""

from __future__ import annotations

import time
from pathlib import Path

import fmpy
import numpy as np
import pytest
from scipy.linalg import expm

from fmus.kit import UserError
from orchestration.fmu import Fmu, find_model
from orchestration.fmu.exchange import ExchangeFmu
from orchestration.fmu.kernel import library
from orchestration.fmu.simulation import EndedSimulation, RepeatedFmu, simulate_instance
from tests.support.archive import edited
from tests.support.fmi3_fmus import build, build_wide, foreign

STEP = 0.05
TIME = STEP * np.arange(41)
WAVE = np.sin(3.0 * TIME)


def run(path: Path, settings=None, inputs=None, time=TIME) -> dict[str, np.ndarray]:
    with Fmu(path, settings) as fmu:
        fmu.start(float(time[0]))
        return simulate_instance(fmu, time, inputs or {})


def by_fmpy(path: Path, inputs: np.ndarray | None = None, **settings) -> np.ndarray:
    return fmpy.simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        validate=False,
        stop_time=TIME[-1],
        output_interval=STEP,
        input=inputs,
        start_values=settings,
    )


def held(values: np.ndarray) -> np.ndarray:
    """Inputs for fmpy, which goes straight between points, as steps."""
    times = np.repeat(TIME, 2)[1:]
    rows = np.repeat(values, 2, axis=0)[:-1]
    shape = values.shape[1:]
    table = np.zeros(len(times), dtype=[("time", float), ("u", float, shape)])
    table["time"] = times
    table["u"] = rows
    return table


def test_a_lag_gives_the_closed_form_and_the_numbers_of_fmpy():
    found = run(foreign("lag"), {"k": 3.0, "tau": 0.2}, {"u": WAVE})
    states = [0.25]
    for u in WAVE[:-1]:
        states.append(3.0 * u + (states[-1] - 3.0 * u) * np.exp(-STEP / 0.2))
    np.testing.assert_allclose(found["y"], states, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["also_y"], found["y"])
    theirs = by_fmpy(foreign("lag"), held(WAVE), k=3.0, tau=0.2)
    np.testing.assert_allclose(found["y"], theirs["y"], rtol=0, atol=1e-12)


def test_arrays_go_in_and_out_by_their_elements():
    a = np.array([[-1.0, 0.5, 0.0], [0.0, -2.0, 0.5], [0.7, 0.0, -3.0]])
    b = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    c = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    u = np.column_stack([WAVE, np.cos(TIME)])
    found = run(foreign("arrays"), {"A[3,1]": 0.7}, {"u[1]": u[:, 0], "u[2]": u[:, 1]})
    whole = expm(STEP * np.block([[a, b], [np.zeros((2, 5))]]))
    states = [np.array([0.1, 0.2, 0.3])]
    for row in u[:-1]:
        states.append(whole[:3, :3] @ states[-1] + whole[:3, 3:] @ row)
    outputs = np.array(states) @ c.T
    np.testing.assert_allclose(found["y[1]"], outputs[:, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["y[2]"], outputs[:, 1], rtol=0, atol=1e-12)
    theirs = by_fmpy(foreign("arrays"), held(u), A=a.ravel())["y"]
    np.testing.assert_allclose(found["y[1]"], theirs[:, 0], rtol=0, atol=1e-12)


def test_elements_are_set_where_nothing_can_be_read_before_initialization(tmp_path):
    strict = build("arrays", tmp_path, "-DSTRICT")
    settings = {"A[3,1]": 0.7, "A[1,1]": -1.5, "u[2]": 1.0, "A[3,3]": -4.0}
    found = run(strict, settings)
    expected = run(foreign("arrays"), settings)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)
    with RepeatedFmu(strict) as runs:
        for _ in range(2):
            rows = runs.run(TIME, {}, settings, ["y[1]"])
            np.testing.assert_array_equal(rows[:, 0], expected["y[1]"])
        other = runs.run(TIME, {}, {}, ["y[1]"])
    assert np.abs(other[:, 0] - expected["y[1]"]).max() > 0.01


@pytest.mark.parametrize(
    ("writes", "expected"),
    [
        ([{1: 5.0}, {1: 1.0, 2: 2.0}], [1.0, 2.0]),
        ([{1: 1.0, 2: 2.0}, {1: 5.0}, {1: 1.0, 2: 2.0}], [1.0, 2.0]),
        ([{1: 1.0, 2: 2.0}, {2: 5.0}], [1.0, 5.0]),
    ],
)
def test_the_latest_of_values_before_initialization_counts(tmp_path, writes, expected):
    """Of an element that waits for the others of its array, and of the whole array."""
    with Fmu(build_wide(2, tmp_path)) as fmu:
        one = fmu._slave
        references = {i: fmu.variable(f"u[{i}]").valueReference for i in (1, 2)}
        one.setupExperiment(startTime=0.0)
        for values in writes:
            one.setReal([references[i] for i in values], list(values.values()))
        one.enterInitializationMode()
        assert one.getReal(list(references.values())) == expected


@pytest.mark.parametrize("events", [False, True])
def test_events_inside_of_steps_are_as_the_fmu_has_them_with_and_without_event_mode(events):
    found = run(foreign("sawtooth"), {"slope": 2.0})
    theirs = fmpy.simulate_fmu(
        str(foreign("sawtooth")),
        fmi_type="CoSimulation",
        stop_time=TIME[-1],
        output_interval=STEP,
        start_values={"slope": 2.0},
        use_event_mode=events,
        early_return_allowed=events,
    )
    count = np.floor(TIME / 0.3 + 1e-9)
    np.testing.assert_array_equal(found["count"], count)
    np.testing.assert_allclose(found["x"], 2.0 * (TIME - 0.3 * count), rtol=0, atol=1e-12)
    last = {float(f"{row['time']:.9f}"): row for row in theirs}  # after an event
    rows = [last[float(f"{t:.9f}")] for t in TIME]
    np.testing.assert_allclose(found["x"], [row["x"] for row in rows], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["count"], [row["count"] for row in rows])


def test_a_step_that_ends_early_goes_on_to_its_end():
    honest = run(foreign("sawtooth"))
    early = run(foreign("sawtooth"), {"manner": 1})
    for name, values in honest.items():
        np.testing.assert_allclose(early[name], values, rtol=0, atol=1e-12)


def test_one_that_asks_for_event_mode_is_warned_of():
    with Fmu(foreign("sawtooth"), {"manner": 2}) as fmu:
        fmu.start()
        simulate_instance(fmu, TIME, {})
        assert fmu.complaints.startswith("6 calls ended with a warning (it asked for event mode")


@pytest.mark.parametrize(
    ("manner", "message"),
    [
        (3, r"asks to end the simulation in place of a step from 0.3 s: .* ends at 0.3 s"),
        (4, r"step from 0 s failed \(error\): it returned early .* and got no further"),
    ],
)
def test_one_that_cannot_go_on_says_so(manner, message):
    with pytest.raises(UserError, match=message):
        run(foreign("sawtooth"), {"manner": manner}, time=0.3 * np.arange(4))


@pytest.mark.parametrize("kernel", [True, False])
@pytest.mark.parametrize(("step", "count"), [(0.1, 4), (0.2, 2)])
def test_one_that_ends_its_simulation_leaves_all_until_then(step, count, kernel, monkeypatch):
    """A step that is cut short has its values at the time that it has reached."""
    if not kernel:
        monkeypatch.setattr(library, "load_stepper", lambda: None)
    points = step * np.arange(8)
    with pytest.raises(EndedSimulation, match=r"its simulation ends at 0\.3 s") as ended:
        run(foreign("sawtooth"), {"manner": 3}, time=points)
    reached = points[:count] if step == 0.1 else [*points[:count], 0.3]
    np.testing.assert_allclose(ended.value.time, reached, rtol=0, atol=1e-12)
    assert ended.value.outputs["count"][-1] == 1
    run(foreign("sawtooth"), {"manner": 3}, time=points[:count])


TYPES = {
    "f32_in": 0.1,
    "f64_in": 0.1,
    "i8_in": -128,
    "u8_in": 254,
    "i16_in": -32768,
    "u16_in": 65534,
    "i32_in": -(2**31) + 1,
    "u32_in": 7,
    "i64_in": 2**31 - 1,
    "u64_in": 5,
    "bool_in": 1,
    "mood_in": -4,
    "word": "longer \u00b5",
    "words[2]": "four",
    "whole[2,1]": -7,
    "bits[2]": 1,
    "bits[3]": 0,
    "blob": "00fFAb",
    "blobs[2]": "",
}
ANSWERS = {
    "f32_out": float(np.float32(0.1) * np.float32(2.0)),
    "f64_out": 0.2,
    "i8_out": -127,
    "u8_out": 255,
    "i16_out": -32767,
    "u16_out": 65535,
    "i32_out": -(2**31) + 2,
    "u32_out": 3_000_000_007,
    "i64_out": 2**31 - 1 - 2**50,
    "u64_out": 2**52 + 5,
    "bool_out": 0,
    "mood_out": 1,
    "length": 9 + 10 * 2 + 100 * 4,
    "sum": 91 - 4 * 11,
    "parity": 1,
    "from_file": 4.25,
    "mirrored": "07abff00",
}


def test_every_type_is_exchanged_exactly():
    found = run(foreign("types"), TYPES, time=TIME[:2])
    assert {name: values[-1] for name, values in found.items()} == ANSWERS


def test_texts_and_binaries_are_read_by_one_call():
    names = ("mirrored", "word", "blob", "blobs[1]")
    with Fmu(foreign("types")) as fmu:
        fmu.start()
        texts = fmu._slave.getString([fmu.variable(name).valueReference for name in names])
    assert texts == [b"0707ff00", b"abc", b"00ff", b"07"]


def test_an_integer_that_a_real_rounds_is_warned_of():
    with Fmu(foreign("types"), {"u64_in": 2**53 - 1}) as fmu:
        fmu.start()
        row = np.empty(1)
        fmu.reader(["u64_out"])(row)
        assert "is beyond 2^53 and rounded" in fmu.complaints


@pytest.mark.parametrize("smallest", [-(2**31), 2**31 - 1])
def test_the_largest_integers_go_in(smallest):
    settings = {"i64_in": smallest, "i32_in": min(smallest, 2**31 - 2)}
    found = run(foreign("types"), settings, {"i64_in": np.full(2, smallest)}, time=TIME[:2])
    assert found["i64_out"][-1] == smallest - 2**50
    assert found["i32_out"][-1] == settings["i32_in"] + 1


@pytest.mark.parametrize("large", [1.7e38, -1.7e38])
def test_a_short_float_takes_what_it_can_hold(large):
    found = run(foreign("types"), {"f32_in": large}, time=TIME[:2])
    assert found["f32_out"][-1] == 2.0 * np.float64(np.float32(large))


def test_texts_are_read_whole():
    with Fmu(foreign("types"), {"words[1]": "first"}) as fmu:
        fmu.start()
        names = ("words[2]", "word", "words[1]")
        references = [fmu.variable(name).valueReference for name in names]
        texts = fmu._slave.getString(references)
    assert texts == [b"f", b"abc", b"first"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"u8_in": 256}, "setting u8_in failed.*: 256 is no value of the type"),
        ({"f32_in": 1e40}, r"setting f32_in failed.*: 1e\+40 is no value of the type"),
        ({"u32_in": -1}, "setting u32_in failed.*: -1 is no value of the type"),
        ({"i64_in": -(2.0**63)}, "setting i64_in failed.*: -9.2.*e.18 is beyond 2.53, up to which"),
        ({"u64_in": -1}, "setting u64_in failed.*: -1 is no value of the type"),
        ({"i8_in": 1.5}, "i8_in: 1.5 is not a whole number"),
        ({"bool_in": 2}, "bool_in: 2 is neither true"),
        ({"n": 4}, "no variable named 'n'"),
        ({"blob": "0g"}, "setting blob failed.*: 0g is no binary value: two hexadecimal digits"),
        ({"blob": "00f"}, "setting blob failed.*: 00f is no binary value"),
        ({"word": 1.0}, "word: 1.0 is a number; the parameter is a text"),
    ],
)
def test_a_value_that_a_type_cannot_hold_is_refused(settings, message):
    with pytest.raises(UserError, match=message) as caught:
        run(foreign("types"), settings, time=TIME[:2])
    assert "\n" not in str(caught.value)


def test_the_size_of_an_array_cannot_be_set():
    with pytest.raises(UserError, match="n is local, only parameters, inputs and start"):
        run(foreign("arrays"), {"n": 4})


@pytest.mark.parametrize(
    ("name", "value", "refused"),
    [("i64", -(2.0**40), 2.0**53), ("u64", 2.0**53 - 1.0, -1.0), ("u32", 2.0**32 - 1.0, 2.0**32)],
)
def test_an_integer_of_up_to_64_bits_is_set_and_read(name, value, refused):
    model = find_model(str(foreign("types")))
    assert model.inputs[f"{name}_in"].type == "integer"
    values = model.settings([f"{name}_in={value:.0f}"])
    with Fmu(foreign("types"), values) as fmu:
        fmu.start()
        row = np.empty(1)
        fmu.reader([f"{name}_in"])(row)
    assert row[0] == value
    for given in (f"{refused:.0f}", "0.5"):
        with pytest.raises(UserError, match=f"{name}_in"):
            model.settings([f"{name}_in={given}"])


def test_states_are_saved_restored_and_written_down():
    with Fmu(foreign("sawtooth")) as fmu:
        fmu.start()
        fmu.step(0.0, 0.5)
        saved = fmu.save()
        written = fmu._slave.serializeFMUstate(saved)
        row = np.empty(2)
        read = fmu.reader(["x", "count"])
        for _ in range(2):
            fmu.step(0.5, 0.5)
            read(row)
            np.testing.assert_allclose(row, [0.1, 3.0], atol=1e-12)
            fmu.restore(saved)
        fmu.release(saved)
        again = fmu._slave.deSerializeFMUstate(written)
        fmu.restore(again)
        read(row)
        np.testing.assert_allclose(row, [0.2, 1.0], atol=1e-12)
        fmu.release(again)


def test_a_reset_instance_begins_again():
    inputs = {"u[1]": WAVE, "u[2]": WAVE}
    with RepeatedFmu(foreign("arrays")) as runs:
        first = runs.run(TIME, inputs, {}, ["y[1]", "y[2]"])
        other = runs.run(TIME, inputs, {"A[2,2]": -9.0}, ["y[1]", "y[2]"])
        np.testing.assert_array_equal(runs.run(TIME, inputs, {}, ["y[1]", "y[2]"]), first)
    assert np.abs(other - first).max() > 0.01


def test_directional_derivatives_are_of_elements():
    with Fmu(foreign("arrays"), {"A[1,3]": 0.3}) as fmu:
        fmu.start()
        rates = [f"der(x[{k}])" for k in (3, 1)]
        found = fmu.directional_derivatives(rates, ["x[1]", "x[3]", "u[1]"])
    np.testing.assert_array_equal(found, [[0.0, -3.0, 1.0], [-1.0, 0.3, 1.0]])


def test_model_exchange_gives_rates_at_states():
    with ExchangeFmu(foreign("arrays"), {"u[1]": 2.0}) as fmu:
        fmu.start()
        assert fmu.states == ["x[1]", "x[2]", "x[3]"]
        np.testing.assert_allclose(fmu.get_states(), [0.1, 0.2, 0.3], rtol=1e-15)
        fmu.enter_continuous_time(0.0, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(fmu.get_rates(), [2.0, -2.5, -7.0], rtol=1e-14)
        assert not fmu.samples
    with ExchangeFmu(foreign("sawtooth")) as fmu:
        fmu.start()
        fmu.enter_continuous_time(0.0, [0.0])
        assert fmu.samples


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda n, c: (n, c.replace(b'instantiationToken="lag"', b'instantiationToken="gal"')),
            r"cannot be loaded \(the instantiation token is another\)",
        ),
        (
            lambda n, c: (n.replace(fmpy.platform_tuple, "riscv32-plan9"), c),
            rf"no binary for {fmpy.platform_tuple}; it has riscv32-plan9",
        ),
        (
            lambda n, c: (n, b"no library" if n.startswith("binaries") else c),
            r"cannot be loaded \(its library cannot be loaded \(",
        ),
        (
            lambda n, c: (n.replace("lag.", "gal."), c),
            rf"binaries/{fmpy.platform_tuple}/lag\.\w+ is missing",
        ),
        (
            lambda n, c: (n, c.replace(b'modelIdentifier="lag"', b'modelIdentifier="../lag"')),
            r"modelIdentifier '\.\./lag' is no name of a library",
        ),
    ],
)
def test_what_cannot_be_loaded_is_a_line(tmp_path, scratch, edit, message):
    path = edited(foreign("lag"), tmp_path / "other.fmu", edit)
    here = Path.cwd()
    with pytest.raises(UserError, match=message) as caught, Fmu(path):
        pass
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert Path.cwd() == here
    assert list(scratch.iterdir()) == []


def test_several_instances_in_one_process_do_not_meet():
    with Fmu(foreign("lag"), {"k": 1.0}) as one, Fmu(foreign("lag"), {"k": 5.0}) as other:
        for fmu in (one, other):
            fmu.start()
        found = [
            simulate_instance(fmu, TIME, {"u": np.ones(TIME.size)})["y"][-1] for fmu in (one, other)
        ]
    rest = np.exp(-TIME[-1] / 0.5)
    np.testing.assert_allclose(found, [1.0 - 0.75 * rest, 5.0 - 4.75 * rest], rtol=1e-12)


@pytest.mark.slow
def test_the_time_of_an_exchange_is_linear_in_the_number_of_elements(tmp_path):
    """Eight times the elements may take thirty times as long, but not sixty-four times."""
    spent = []
    for count in (4_000, 32_000):
        folder = tmp_path / str(count)
        folder.mkdir()
        with Fmu(build_wide(count, folder)) as fmu:
            fmu.start()
            write = fmu.writer(list(reversed(fmu.inputs)))
            read = fmu.reader(fmu.outputs)
            row = np.arange(float(count))
            answer = np.empty(count)
            times = []
            for _ in range(20):
                begun = time.perf_counter()
                write(row)
                read(answer)
                times.append(time.perf_counter() - begun)
            np.testing.assert_array_equal(answer, 2.0 * row[::-1])
            spent.append(min(times))
    assert spent[1] < 30.0 * spent[0]


def test_the_table_lists_types_references_and_sizes(tmp_path):
    with Fmu(foreign("arrays")) as fmu:
        table = next(Path(str(fmu._folder)).rglob("arrays.table")).read_text().splitlines()
    library = f"arrays{fmpy.sharedLibraryExtension}"
    assert Path(table[0]).parts[-2:] == (fmpy.platform_tuple, library)
    rows = ["1 0 1", "9 1 1", "1 2 9", "1 3 6", "1 4 6", "1 5 2", "1 6 3", "1 7 3", "1 8 2"]
    assert table[1:] == ["", str(len(rows)), *rows, "0 0"]
