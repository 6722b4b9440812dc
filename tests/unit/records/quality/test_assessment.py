"""Claims: faults of the data are found where they are, nowhere else, and no model is blamed for
them.

Records are those of the emulated rig; the faults are laid over them here, so that the samples
concerned are known.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from demonstrations.bench import NOISE
from demonstrations.records import UNITS, draw, write
from fmus.kit.record.compiled import CompiledModel
from fmus.voice_coil_dma.model import VoiceCoilDma
from orchestration.experiment.waveforms import multilevel
from orchestration.records import read_record
from orchestration.records.quality import Channels, assess
from tests.support.diagnosis import short_record

LIMIT = 0.8  # V, of a recorder


def record(seed=1, hidden=None, **options):
    return short_record(hidden, seed, **{"rate": 10.0} | options).channels


def changed(data, **outputs):
    return Channels(data.time, data.inputs, {**data.outputs, **outputs})


def kinds(faults):
    return {(f.channel, f.kind) for f in faults}


# --- no false alarm
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_clean_records_are_clean():
    """Seven records of each of eight kinds; the inputs of all of them jump among few levels and
    rest at their ends.
    """
    for seed in range(56):
        colour, rate, duration = (
            (0.0, 0.9)[seed % 2],
            (2.0, 10.0)[seed // 2 % 2],
            (180.0, 600.0)[seed // 4 % 2],
        )
        data = record(seed, noise_colour=colour, rate=rate, duration=duration, at_rest=seed % 3 > 0)
        usable, faults = assess(data)
        assert faults == []
        assert all(np.array_equal(usable.outputs[o], y) for o, y in data.outputs.items())


@pytest.mark.parametrize(
    "hidden", ["strain_saturation", "transport_delay", "slip_jumps", "hum", "loose_contact"]
)
def test_what_a_rig_does_is_no_fault_of_the_data(hidden):
    assert assess(record(1, hidden))[1] == []


@pytest.mark.parametrize("steps", [0.25, 1.0, 4.0, 12.0])
def test_a_recorder_with_steps_is_at_most_coarse(steps):
    """Steps in units of the noise; those far above it are told, and nothing is left out."""
    for seed in range(8):
        data = record(seed, rate=(2.0, 10.0)[seed % 2])
        rounded = {
            o: np.round(y / (steps * NOISE[o])) * steps * NOISE[o] for o, y in data.outputs.items()
        }
        usable, faults = assess(changed(data, **rounded))
        assert {f.kind for f in faults} <= {"quantised"}
        assert not any(np.isnan(y).any() for y in usable.outputs.values())
        if steps > 10.0:
            assert kinds(faults) == {("voltage", "quantised"), ("displacement", "quantised")}


def test_a_reader_does_not_call_levels_of_an_input_clipped(tmp_path):
    drawn = draw(None, 1, duration=100.0)
    write(drawn, tmp_path / "record.csv")
    read = read_record(tmp_path / "record.csv", UNITS, inputs=["current", "force"])
    assert [repair.message for repair in read.repairs] == []
    as_output = read_record(tmp_path / "record.csv", UNITS)
    assert {"clipped", "quantised"} <= {repair.kind for repair in as_output.repairs}


def test_what_a_model_does_itself_is_no_fault():
    """The amplifier of the motor saturates, which is no recorder's doing."""
    time = 0.1 * np.arange(3000)
    model = CompiledModel(VoiceCoilDma)
    real = [v.name for v in model.layout.inputs if v.type == "real"]
    inputs = {
        name: multilevel(time, [-1.0, 0.0, 0.5, 1.0], (1.0, 8.0), seed)
        for seed, name in enumerate(real)
    }
    shown = model.run(time, inputs).signals
    data = Channels(time, inputs, {o.name: shown[o.name] for o in model.layout.outputs})
    assert ("coil_voltage", "clipped") in kinds(assess(data)[1])
    assert assess(data, data.outputs)[1] == []


# --- what stands still is evidence
# -----------------------------------------------------------------------------------


def driven(response, seed=0):
    """A plant without noise, read in steps of 0.01, that is driven by steps of many sizes and
    responds like this.
    """
    time = 0.1 * np.arange(3000)
    pushed = np.repeat(np.random.default_rng(seed).uniform(-1.0, 1.0, 100), 30)
    moved = lfilter([0.1], [1.0, -0.9], response(pushed))
    return Channels(time, {"u": pushed}, {"y": 0.01 * np.round(moved / 0.01)})


@pytest.mark.parametrize(
    "response",
    [
        lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0),
        lambda u: np.maximum(u, 0.3),
        lambda u: np.where(np.arange(u.size) < 1500, 0.0, u),
    ],
    ids=["dead zone", "stop", "late start"],
)
def test_a_plant_that_stands_still_is_used_in_full(response):
    data = driven(response)
    usable, faults = assess(data)
    assert all(fault.is_evidence for fault in faults)
    assert np.array_equal(usable.outputs["y"], data.outputs["y"])


def test_a_plant_at_rest_between_noisy_moves_is_used_in_full():
    """An encoder shows noise while the shaft turns, and none while it stands."""
    data = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), 1)
    speed = data.outputs["y"]
    noisy = np.where(
        speed == 0.0, 0.0, speed + 0.02 * np.random.default_rng(1).standard_normal(speed.size)
    )
    usable, faults = assess(changed(data, y=noisy))
    assert [fault.code for fault in faults if not fault.is_evidence] == []
    assert np.isfinite(usable.outputs["y"]).all()


def test_a_motor_with_a_dead_zone_is_used_in_full(public_data):
    record = read_record(
        public_data("dc_motor_dead_zone.csv"),
        {"speed": "rad/s", "voltage": "V"},
        inputs=["voltage"],
    )
    inputs = {"voltage": record.signals["voltage"]}
    usable, faults = assess(Channels(record.time, inputs, {"speed": record.signals["speed"]}))
    assert np.isfinite(usable.outputs["speed"]).all()
    assert "stands_still" in {fault.code for fault in faults}


def test_a_sensor_without_noise_that_hangs_and_comes_back_is_left_out_there():
    data = driven(lambda u: u)
    y = data.outputs["y"].copy()
    y[1000:1400] = y[1000]
    assert abs(y[1400] - y[1399]) > 0.1
    usable, faults = assess(changed(data, y=y))
    assert ("y", "stuck") in kinds(faults)
    assert np.isnan(usable.outputs["y"])[1001:1399].all()


# --- faults
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("colour", [0.0, 0.9])
@pytest.mark.parametrize("rate", [2.0, 10.0])
def test_a_clipped_output_is_left_out_where_it_is_clipped(colour, rate):
    for seed in range(5):
        data = record(seed, noise_colour=colour, rate=rate)
        cut = np.abs(data.outputs["voltage"]) >= LIMIT
        voltage = np.clip(data.outputs["voltage"], -LIMIT, LIMIT)
        usable, faults = assess(changed(data, voltage=voltage))
        assert kinds(faults) <= {("voltage", "clipped")}
        left_out = np.isnan(usable.outputs["voltage"])
        ends = {1.0 if f.facts["end"] == "maximum" else -1.0 for f in faults}
        known = cut & np.isin(np.sign(voltage), list(ends))
        assert left_out[known].all()
        assert (cut & ~known).sum() < 0.02 * cut.size  # an end that is hardly reached
        assert (
            left_out & ~cut
        ).sum() <= 0.05 * cut.sum()  # noise has spared them; they lie between clipped ones
        assert sum(f.facts["share"] for f in faults) == pytest.approx(left_out.mean())


@pytest.mark.parametrize("value", ["last", "zero"])
def test_a_sensor_that_dies_is_left_out_from_then_on(value):
    data = record()
    dies = round(0.6 * data.time.size)
    displacement = data.outputs["displacement"].copy()
    displacement[dies:] = displacement[dies] if value == "last" else 0.0
    usable, (fault,) = assess(changed(data, displacement=displacement))
    assert (fault.channel, fault.kind) == ("displacement", "dead")
    assert np.array_equal(
        np.isnan(usable.outputs["displacement"]), np.arange(data.time.size) >= dies
    )


def test_a_sensor_that_hangs_for_a_while_is_left_out_there():
    data = record()
    displacement = data.outputs["displacement"].copy()
    displacement[1000:1400] = displacement[1000]
    usable, (fault,) = assess(changed(data, displacement=displacement))
    assert (fault.kind, fault.facts["samples"]) == ("stuck", 400)
    left_out = np.flatnonzero(np.isnan(usable.outputs["displacement"]))
    assert np.array_equal(left_out, np.arange(1000, 1400))


@pytest.mark.parametrize("dead", ["constant", "toggling"])
def test_a_sensor_that_is_dead_from_the_start_is_not_used(dead):
    data = record()
    toggling = np.random.default_rng(1).integers(0, 2, data.time.size)
    displacement = 1e-6 * (toggling if dead == "toggling" else np.ones(data.time.size))
    usable, (fault,) = assess(changed(data, displacement=displacement))
    assert (fault.channel, fault.kind, fault.facts["share"]) == ("displacement", "dead", 1.0)
    assert list(usable.outputs) == ["voltage"]
    nothing, faults = assess(Channels(data.time, data.inputs, {"displacement": displacement}))
    assert nothing.outputs == {}
    assert faults[-1].code == "nothing_usable"
    assert faults[-1].sentence == "no output is left that could be trusted: nothing can be judged"


def test_single_samples_far_away_are_left_out():
    data = record()
    still = ~np.any(
        [
            np.convolve(np.diff(u, prepend=u[0]) != 0.0, np.ones(5), "same")
            for u in data.inputs.values()
        ],
        0,
    )
    which = np.random.default_rng(1).choice(np.flatnonzero(still)[5:-5:5], 12, replace=False)
    displacement = data.outputs["displacement"].copy()
    displacement[which] += 2e-4
    usable, (fault,) = assess(changed(data, displacement=displacement))
    assert fault.kind == "outlier"
    assert set(np.flatnonzero(np.isnan(usable.outputs["displacement"]))) == set(which)


def test_a_smooth_signal_that_is_cut_needs_no_noise_to_be_seen():
    time = 0.1 * np.arange(2000)
    wave = np.sin(0.3 * time)
    usable, faults = assess(Channels(time, {"u": wave}, {"y": np.clip(wave, -1.0, 0.7)}))
    assert kinds(faults) == {("y", "clipped")}
    assert np.array_equal(np.isnan(usable.outputs["y"]), wave >= 0.7)
    assert assess(Channels(time, {"u": wave}, {"y": 2.0 * wave}))[1] == []


def test_a_noisy_output_is_clipped_under_an_input_that_never_rests():
    time = 0.1 * np.arange(3000)
    u = sum(np.sin(w * time + w) for w in (0.11, 0.23, 0.41))
    y = u + 0.05 * np.random.default_rng(1).standard_normal(time.size)
    level = np.quantile(y, 0.6)
    usable, faults = assess(Channels(time, {"u": u}, {"y": np.minimum(y, level)}))
    assert kinds(faults) == {("y", "clipped")}
    assert np.isnan(usable.outputs["y"][y > level]).all()
    assert np.isnan(usable.outputs["y"]).mean() < 0.46
    assert assess(Channels(time, {"u": u}, {"y": y}))[1] == []


def test_values_that_a_coarse_recorder_repeats_in_a_sweep_are_no_noise():
    time = 0.01 * np.arange(3000)
    u = np.sin(0.02 * time + 0.1 * time**2)
    y = np.round((u + 0.02 * np.random.default_rng(1).standard_normal(time.size)) / 0.05) * 0.05
    assert kinds(assess(Channels(time, {"u": u}, {"y": y}))[1]) == {("y", "quantised")}


@pytest.mark.parametrize(("widths", "told"), [(0.4, {"quantised"}), (5.0, set())])
def test_steps_within_the_noise_are_not_called_coarser_than_it(widths, told):
    """Noise in steps of the recorder, under an input that is rough throughout."""
    time = 0.01 * np.arange(3000)
    noise, rough = np.random.default_rng(1).standard_normal((2, time.size))
    u = np.sin(2.0 * time) + 1e-3 * rough
    y = np.round(100.0 * u + widths * noise)
    assert {f.kind for f in assess(Channels(time, {"u": u}, {"y": y}))[1]} == told


def test_gaps_stay_gaps():
    data = record()
    voltage = np.clip(data.outputs["voltage"], -LIMIT, LIMIT)
    voltage[100:200] = np.nan
    usable, _ = assess(changed(data, voltage=voltage))
    assert np.isnan(usable.outputs["voltage"][100:200]).all()


# --- excitation
# --------------------------------------------------------------------------------------------------


def test_inputs_that_do_not_move_are_told():
    data = record()
    still = {**data.inputs, "force": np.full(data.time.size, 0.5)}
    _, (fault,) = assess(Channels(data.time, still, data.outputs))
    assert (fault.code, fault.facts) == ("constant_input", {"value": 0.5, "share": 1.0})
    assert fault.sentence.startswith(
        "force: constant at 0.5 throughout: what only answers to its changes cannot"
    )
    assert fault.is_evidence
    _, faults = assess(
        Channels(data.time, {n: 0.0 * u for n, u in data.inputs.items()}, data.outputs)
    )
    assert faults[-1].code == "no_excitation"
    assert faults[-1].sentence.startswith(
        "no input moves, and no output by more than its noise: neither a cause nor a parameter can"
    )


# --- copies
# --------------------------------------------------------------------------------------------------


def test_an_output_that_is_the_copy_of_an_input_is_not_used():
    data = record()
    usable, faults = assess(changed(data, voltage=data.inputs["current"].copy()))
    assert ("voltage", "copied") in kinds(faults)
    assert "voltage" not in usable.outputs
    same = {"voltage": data.inputs["current"]}  # as a model does that passes it on
    usable, faults = assess(changed(data, voltage=data.inputs["current"].copy()), same)
    assert ("voltage", "copied") not in kinds(faults)
    assert "voltage" in usable.outputs
