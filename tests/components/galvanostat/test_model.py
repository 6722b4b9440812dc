"""The galvanostat against its data sheet and fig. 4-4: closed forms, and solutions written out by
hand here.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from fmus.galvanostat.model import Galvanostat
from fmus.kit import UserError
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel

# Thesis tables 2-2 and 3-1, typed in here: no number is taken from the model.
LIMIT, COMPLIANCE = 1.3, 15.0
R1, R2, C = 0.43, 2.35, 2.70


def drive(model, times, **inputs):
    """Outputs at the communication points, with the inputs of the same point; inputs are numbers or
    functions.
    """
    integrator = Integrator(model)
    rows = []
    for k, time in enumerate(times):
        for name, value in inputs.items():
            setattr(model, name, value(time) if callable(value) else value)
        rows.append([float(v) for v in model.outputs()])
        if k + 1 < len(times):
            integrator.advance(time, times[k + 1] - time)
    return dict(zip(("current", "saturated", "recovering"), np.array(rows).T, strict=True))


def test_signals_and_numbers_of_table_2_2():
    layout = Galvanostat.layout
    assert {v.name: v.unit for v in layout.inputs} == {
        "current_command": "A",
        "voltage": "V",
        "voltage_limit": "V",
        "voltage_command": "V",
    }
    assert [(v.name, v.unit, v.type) for v in layout.measurable] == [
        ("current", "A", "real"),
        ("saturated", "1", "boolean"),
        ("recovering", "1", "boolean"),
    ]
    defaults = {p.name: p.start for p in layout.parameters}
    assert (defaults["current_limit"], defaults["compliance_voltage"]) == (1.3, 15.0)
    assert not any(
        defaults[n]
        for n in ("response_time", "control_tolerance", "voltage_tolerance", "potentiostat")
    )
    instrument = Galvanostat.presets["ha_151"].values
    assert (
        instrument["response_time"],
        instrument["control_tolerance"],
        instrument["voltage_tolerance"],
    ) == (
        50e-6,
        1e-3,
        3e-3,
    )


@given(command=st.floats(-100, 100))
def test_current_follows_the_command_up_to_the_limit(command):
    current, saturated, recovering = Galvanostat(current_command=command).outputs()
    assert current == min(max(command, -LIMIT), LIMIT)
    assert saturated == (abs(command) > LIMIT)
    assert not recovering


@given(command=st.floats(-1.2, 1.2), tolerance=st.floats(0, 0.1))
def test_current_deviates_by_the_tolerance_at_most(command, tolerance):
    current = Galvanostat(current_command=command, control_tolerance=tolerance).current()
    assert abs(current - command) <= tolerance + 1e-15
    assert current == pytest.approx(
        math.copysign(max(abs(command) - tolerance, 0.0), command), abs=1e-15
    )


# --- protection of fig. 4-4
# -------------------------------------------------------------------------------------------


def test_current_is_zero_for_the_recovery_time_and_then_resumes():
    times = np.arange(0, 3.0, 0.005)
    pulse = drive(
        Galvanostat(recovery_time=0.5),
        times,
        current_command=0.9,
        voltage_limit=1.0,
        voltage=lambda t: 1.2 if 0.9999 < t < 1.2 else 0.3,
    )
    # the sample at 1 s is taken in the step that begins there, so its effect is seen 5 ms later
    off = (times > 1.0001) & (times < 1.5001)
    assert np.array_equal(pulse["current"], np.where(off, 0.0, 0.9))
    assert np.array_equal(pulse["recovering"], off)
    assert not pulse["saturated"].any()


def test_a_voltage_still_beyond_the_limit_begins_the_next_recovery():
    times = np.arange(0, 3.0, 0.01)
    found = drive(
        Galvanostat(recovery_time=0.2),
        times,
        current_command=0.9,
        voltage_limit=1.0,
        voltage=lambda t: -1.5 if 0.499 < t < 0.85 else 0.0,
    )
    off = (times > 0.5001) & (times < 0.9001)  # looked at 0.5 s, 0.7 s and 0.9 s
    assert np.array_equal(found["recovering"], off)
    assert np.array_equal(found["current"], np.where(off, 0.0, 0.9))


@settings(max_examples=60)
@given(
    periods=st.integers(0, 300),
    period=st.sampled_from([0.01, 0.003, 0.1, 0.07]),
    share=st.sampled_from([0.0, 0.3, 0.9]),
)
def test_recovery_lasts_whole_periods(periods, period, share):
    """Rounded up, at least one; a product of decimals that is whole on paper is not one more."""
    model = Galvanostat(
        recovery_time=(periods + share) * period, protection_period=period, voltage_limit=1.0
    )
    integrator = Integrator(model)
    count = max(periods + (share > 0.0), 1)
    model.voltage, k, off = 2.0, 0, 0
    while k < count + 3:
        integrator.advance(k * period, (k + 1) * period - k * period)
        model.voltage = 0.0
        off += bool(model.recovering())
        k += 1
    assert off == count


def test_equal_to_the_limit_is_not_beyond():
    found = drive(
        Galvanostat(), np.arange(0, 1, 0.1), current_command=0.5, voltage=0.8, voltage_limit=0.8
    )
    assert not found["recovering"].any()


@pytest.mark.parametrize("step", [0.0007, 0.01, 0.013, 0.25])
def test_sample_instants_do_not_depend_on_the_communication_step(step):
    """The limit falls below the voltage at the first communication point: the next sample begins
    what never ends.
    """
    times = np.arange(0, 2.0, step)
    found = drive(
        Galvanostat(protection_period=0.03, recovery_time=0.3),
        times,
        current_command=1.0,
        voltage=0.5,
        voltage_limit=lambda t: 1.0 if t < 0.9999 * step else 0.4,
    )
    first = 0.03 * math.ceil(
        step / 0.03 - 1e-9
    )  # first sample that can see the lowered limit; then it never ends
    assert np.array_equal(found["recovering"], times > first + 1e-9)


def exact_closed_loop(command, limit, recovery, period, stop):
    """Current and voltage of the actuator at every sample: the charge in closed form between them
    (eq. 3.5).
    """
    tau, charge, waiting, rows = (R1 + R2) * C, 0.0, 0, []
    samples = round(recovery / period)
    current = 0.0
    for k in range(round(stop / period)):
        wanted = command(k * period)
        current = 0.0 if waiting else min(max(wanted, -LIMIT), LIMIT)
        branch = (R2 * current - charge / C) / (R1 + R2)
        voltage = R1 * branch + charge / C
        rows.append((current, voltage, waiting > 0))
        waiting = waiting - 1 if waiting > 1 else samples * (abs(voltage) > limit)
        current = 0.0 if waiting else min(max(wanted, -LIMIT), LIMIT)
        rest = R2 * C * current
        charge = rest + (charge - rest) * math.exp(-period / tau)
    return np.array(rows, dtype=float)


@pytest.mark.slow
def test_voltage_of_an_actuator_is_kept_at_its_limit():
    """Fig. 4-4: +-1.3 A at 0.1 Hz (section 4.3) on the 12-layer circuit, limited to 0.8 V; closed
    form of the charge.

    The circuit is integrated by scipy from sample to sample, nothing of the actuator component is
    used.
    """
    period, stop, limit = 0.01, 20.0, 0.8

    def command(t):
        return 1.6 if (t + 1e-9) % 10.0 < 5.0 else -1.6

    expected = exact_closed_loop(command, limit, 0.5, period, stop)
    model = Galvanostat(voltage_limit=limit)
    integrator = Integrator(model)
    charge, found = 0.0, []
    for k in range(round(stop / period)):
        model.current_command = command(k * period)

        def branch(q):
            return (R2 * model.current() - q / C) / (R1 + R2)

        model.voltage = R1 * branch(charge) + charge / C
        found.append((model.current(), model.voltage, model.recovering()))
        integrator.advance(k * period, period)
        charge = solve_ivp(
            lambda t, q: branch(q), (0.0, period), [charge], rtol=1e-10, atol=1e-13
        ).y[0, -1]
    found = np.array(found, dtype=float)
    assert np.array_equal(found[:, 2], expected[:, 2])
    assert found[:, :2] == pytest.approx(expected[:, :2], rel=1e-8, abs=1e-9)
    assert 0.05 < expected[:, 2].mean() < 0.95, "the protection acts, but not always"
    # within a sample period the voltage rises by at most i / C, and at an edge of the command it
    # may jump
    assert np.percentile(np.abs(found[:, 1]), 98) < limit + 1.3 * period / C + 1e-9


# --- compliance
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("resistance", [1.0, 11.0, 12.0, 20.0, 150.0, 1e4])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_compliance_settles_at_ohms_law(resistance, direction):
    """The voltage is exchanged once a step, as a master does it."""
    model = Galvanostat(current_command=direction * 1.0, voltage_limit=1e9)
    integrator = Integrator(model)
    for k in range(400):
        model.voltage = resistance * model.current()
        integrator.advance(k * 0.01, 0.01)
    expected = direction * min(1.0, COMPLIANCE / resistance)
    assert model.current() == pytest.approx(expected, rel=1e-9)
    assert model.saturated() == (COMPLIANCE / resistance < 1.0)


def test_compliance_leaves_the_discharging_direction_free():
    found = drive(
        Galvanostat(current_command=-1.0), np.arange(0, 5, 0.1), voltage=100.0, voltage_limit=1e9
    )
    assert np.array_equal(found["current"], np.full(50, -1.0))


def test_compliance_lets_go_again():
    found = drive(
        Galvanostat(),
        np.arange(0, 40, 0.1),
        current_command=1.3,
        voltage_limit=1e9,
        voltage=lambda t: 30.0 if t < 20 else 1.0,
    )
    assert found["current"][199] < 1e-5
    assert found["saturated"][199]
    assert found["current"][-1] == 1.3


def test_compliance_doubles_the_current_per_sample_when_it_lets_go():
    found = drive(
        Galvanostat(compliance_share_start=0.01, sampled_voltage_start=1.0),
        np.arange(0, 0.1, 0.01),
        current_command=1.3,
        voltage=1.0,
        voltage_limit=1e9,
    )
    assert found["current"] == pytest.approx(
        1.3 * np.minimum(0.01 * 2.0 ** np.arange(10), 1.0), rel=1e-12
    )


# --- wind-up of a controller outside
# --------------------------------------------------------------------------------


def charge_loop(model, frozen, reference, stop, initial=0.0, limit=lambda t: LIMIT):
    """PI control of the charge through the galvanostat, the circuit in closed form: rows of charge,
    sum, recovering.
    """
    integrator, period, tau, charge = Integrator(model), 0.01, (R1 + R2) * C, initial
    total, rows = initial / (R2 * C), []  # at rest the current leaks through R2
    for k in range(round(stop / period)):
        error = reference - charge
        if not (frozen and (model.recovering() or model.saturated())):
            total += 1.0 * period * error
        model.current_command, model.voltage_limit = 2.0 * error + total, limit(k * period)
        model.voltage = R1 * (R2 * model.current() - charge / C) / (R1 + R2) + charge / C
        integrator.advance(k * period, period)
        rest = R2 * C * model.current()
        charge = rest + (charge - rest) * math.exp(-period / tau)
        rows.append((charge, total, model.recovering()))
    return np.array(rows, dtype=float).T


def test_an_integrator_outside_winds_up_unless_it_is_frozen():
    """The numbers of the README: 2 C are wanted, the protection acts beyond 0.9 V."""
    figures = {}
    for frozen in (True, False):
        charge, total, recovering = charge_loop(
            Galvanostat(), frozen, 2.0, 30.0, limit=lambda t: 0.9
        )
        began = np.count_nonzero(np.diff(recovering, prepend=0.0) > 0.0)
        settled = 0.01 * (1 + np.max(np.flatnonzero(np.abs(charge / 2.0 - 1.0) > 0.02)))
        figures[frozen] = charge.max(), total.max(), began, settled
    assert figures[True] == pytest.approx((2.02, 0.38, 0, 2.8), abs=0.05)
    assert figures[False][:3] == pytest.approx((1.37, 21.1, 49), rel=0.01)
    assert figures[False][3] >= 30.0, "never settles"


def test_a_controller_frozen_in_recovery_overshoots_less():
    """One recovery of 2 s at rest, begun by a limit that is low for one sample."""
    overshoot = {}
    for frozen in (True, False):
        charge, _, recovering = charge_loop(
            Galvanostat(recovery_time=2.0),
            frozen,
            1.5,
            30.0,
            1.5,
            limit=lambda t: 0.1 if 4.995 < t < 5.005 else 15.0,
        )
        assert np.count_nonzero(recovering) == 200
        assert charge[:500] == pytest.approx(1.5, rel=0.01)
        assert charge.min() == pytest.approx(1.5 * math.exp(-2.0 / ((R1 + R2) * C)), rel=1e-6)
        assert charge[-1] == pytest.approx(1.5, rel=0.01)
        overshoot[frozen] = charge.max() / 1.5 - 1.0
    assert overshoot[True] == pytest.approx(0.03, abs=0.005)
    assert overshoot[False] == pytest.approx(0.10, abs=0.005)


# --- response
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("response", [50e-6, 1e-3, 0.2])
@pytest.mark.parametrize("step", [2e-5, 1e-3, 0.013])
def test_response_is_of_first_order(response, step):
    model = Galvanostat(current_command=2.0, response_time=response)
    times = step * np.arange(40)
    found = drive(model, times)["current"]
    assert found == pytest.approx(LIMIT * -np.expm1(-times / response), rel=1e-6, abs=1e-9)


def test_response_of_63_percent_comes_after_the_time_of_table_2_2():
    model = Galvanostat(**Galvanostat.presets["ha_151"].values, current_command=1.0)
    found = drive(model, np.array([0.0, 50e-6, 1.0]))["current"]
    assert found[1] == pytest.approx((1.0 - math.exp(-1.0)) * 0.999, rel=1e-6)
    assert found[2] == pytest.approx(0.999, rel=1e-7)


def test_no_response_time_is_not_stiff():
    """One internal step for each part between two samples, and no state that moves."""
    model = Galvanostat(current_command=1.0)
    integrator = Integrator(model)
    assert integrator._integrate(0.0, 1e6) == 0
    assert model.lagged_current == 0.0
    assert model.rates() == [0.0]


# --- potentiostat
# --------------------------------------------------------------------------------------------------


def exact_potentiostat(command, period, samples, gain):
    """Recursion of the integral law with the charge in closed form between samples."""
    tau, charge, current, rows = (R1 + R2) * C, 0.0, 0.0, []
    for _ in range(samples):
        voltage = R1 * (R2 * current - charge / C) / (R1 + R2) + charge / C
        rows.append((current, voltage))
        current = min(max(current + gain * period * (command - voltage), -LIMIT), LIMIT)
        rest = R2 * C * current
        charge = rest + (charge - rest) * math.exp(-period / tau)
    return np.array(rows)


@pytest.mark.parametrize("command", [0.3, -0.5, 2.0])
def test_potentiostat_follows_the_sampled_law(command):
    period, samples = 0.01, 6000
    model = Galvanostat(potentiostat=True, voltage_command=command, voltage_limit=100.0)
    integrator = Integrator(model)
    charge, found, saturated = 0.0, [], []
    tau = (R1 + R2) * C
    for k in range(samples):
        current = model.current()
        model.voltage = R1 * (R2 * current - charge / C) / (R1 + R2) + charge / C
        found.append((current, model.voltage))
        saturated.append(bool(model.saturated()))
        integrator.advance(k * period, period)
        rest = R2 * C * model.current()
        charge = rest + (charge - rest) * math.exp(-period / tau)
    expected = exact_potentiostat(command, period, samples, 100.0)
    assert np.array(found) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert found[-1][1] == pytest.approx(command, abs=1e-3)
    assert any(saturated) == (np.abs(expected[:, 0]).max() >= LIMIT)
    # error after each of the first samples shrinks by 1 - 0.3635, as the README says (the charge
    # hardly moves)
    if abs(command) < 0.4:
        errors = command - expected[:12, 1]
        assert errors[1:4] / errors[:3] == pytest.approx(1 - R1 * R2 / (R1 + R2), abs=0.015)


def test_potentiostat_holds_its_integrator_in_recovery():
    model = Galvanostat(
        potentiostat=True, voltage_command=0.5, voltage_limit=1.0, recovery_time=0.3
    )
    integrator = Integrator(model)
    held = []
    for k in range(50):
        model.voltage = 1.5 if k == 10 else 0.45
        integrator.advance(k * 0.01, 0.01)
        if model.recovering():
            held.append(model.control_current)
            assert model.current() == 0.0
    assert len(held) == 30
    assert len(set(held)) == 1
    # ten samples at e = 0.05 V came before, 1 A/V each
    assert held[0] == pytest.approx(10 * 0.05)
    assert model.control_current == pytest.approx(10 * 0.05 + 10 * 0.05)


def test_proportional_gain_is_the_velocity_form_of_pi():
    """Against the position form, the sum of all errors."""
    model = Galvanostat(
        potentiostat=True, proportional_gain=0.3, integral_gain=2.0, current_limit=1e6
    )
    integrator = Integrator(model)
    errors = np.random.default_rng(5).normal(size=60) * 0.01
    for k, error in enumerate(errors):
        model.voltage_command, model.voltage = 1.0, 1.0 - error
        integrator.advance(k * 0.01, 0.01)
        position = 2.0 * 0.01 * errors[: k + 1].sum() + 0.3 * error
        assert model.current() == pytest.approx(position, abs=1e-12)


def test_errors_within_the_voltage_tolerance_are_left_alone():
    model = Galvanostat(
        potentiostat=True, voltage_command=0.5, voltage=0.498, voltage_tolerance=3e-3
    )
    Integrator(model).advance(0.0, 1.0)
    assert model.current() == 0.0


# --- extremes
# --------------------------------------------------------------------------------------------------


@settings(max_examples=100)
@given(data=st.data())
def test_any_parameters_and_inputs_give_a_current_within_the_limit(data):
    layout = Galvanostat.layout
    values = {}
    for p in layout.parameters:
        if p.name.endswith("_start") or p.name.endswith("_period"):
            continue
        choices = [p.start, p.min, p.max] if p.type == "real" else [False, True]
        values[p.name] = data.draw(st.sampled_from(choices))
    values["response_time"] = data.draw(st.sampled_from([0.0, 1e-4, 1e3]))
    model = Galvanostat(**values)
    integrator = Integrator(model)
    for k in range(8):
        for name in ("current_command", "voltage", "voltage_limit", "voltage_command"):
            setattr(
                model,
                name,
                data.draw(st.sampled_from([0.0, 1.0, -1.0, 1e3, -1e300, 1e300, 1e-300])),
            )
        integrator.advance(k * 0.013, 0.013)
        current, *flags = model.outputs()
        assert abs(current) <= values["current_limit"] * (1 + 1e-6) + (
            3e-8 if values["response_time"] else 0.0
        )
        assert all(flag in (0, 1) for flag in flags)


def test_parameters_refuse_what_cannot_be_computed():
    ranges = {p.name: (p.min, p.max) for p in Galvanostat.layout.parameters}
    for name in ("current_limit", "compliance_voltage", "protection_period", "control_period"):
        assert ranges[name][0] > 0
    assert all(
        math.isfinite(low)
        for n, (low, _) in ranges.items()
        if not n.endswith("_start") and n != "potentiostat"
    )
    with pytest.raises(UserError, match="no parameter or input named 'limit'"):
        Galvanostat(limit=1.0)


@pytest.mark.slow
def test_compiled_laws_are_those_of_the_class():
    """The closed loop of fig. 4-4 prescribed as a record; python and C give the same."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.001, 0.05, 200))
    time -= time[0]
    inputs = {
        "current_command": rng.normal(size=200) * 1.5,
        "voltage": rng.normal(size=200),
        "voltage_limit": np.full(200, 2.0),
        "voltage_command": rng.normal(size=200),
    }
    for parameters in (
        {},
        {"potentiostat": 1.0},
        {"response_time": 1e-3, "control_tolerance": 1e-3},
    ):
        compiled = CompiledModel(Galvanostat).run(time, inputs, parameters).signals
        model = Galvanostat(**parameters)
        found = drive(
            model, time, **{n: dict(zip(time, v, strict=True)).get for n, v in inputs.items()}
        )
        for name, values in found.items():
            assert compiled[name] == pytest.approx(values, rel=1e-9, abs=1e-12), name
