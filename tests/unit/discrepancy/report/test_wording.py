"""Every note, whoever makes it, has a sentence with its facts; and why an effect was not named is
said.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from string import Formatter
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.errors import UserError
from fmus.kit.sensors import sensor_drift, sensor_gain, sensor_lag, sensor_offset
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy import conclude as conclusion
from orchestration.discrepancy import diagnosis as diagnosing
from orchestration.discrepancy import final_model, pipeline
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.data import stretch
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.data.screening import (
    drop_truncated,
    note_of,
    screen_and_divide,
    screened,
)
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.residuals.analysis import residual_notes
from orchestration.discrepancy.selection import all_samples, scoring
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.validation.confirmation import FreeRunGain, confirm
from orchestration.discrepancy.validation.estimates import identifiability_notes
from orchestration.discrepancy.validation.prediction import predict
from orchestration.fmu.model import find_model
from orchestration.records.quality import (
    FAULTS,
    Channels,
    ahead_of_inputs,
    assess,
    without_oversampling,
)
from tests.support.battery import analysed
from tests.support.diagnosis import coloured, rig_record, short_record
from tests.support.intersample_records import record
from tests.support.noises import Clean, clean, controlled, gaussian, growing_with_size, outliers
from tests.support.pace import slow_but
from tests.support.regression_model import ASYMMETRY, GAIN, SPREAD, STEP, Amplifier
from tests.support.several import Cell, several
from tests.support.wired_motor import Motor, wired

NOTHING = pipeline.DiagnosisOptions(effects=[])
Maker = Callable[[pytest.MonkeyPatch], list[Note]]
SATURATION = EFFECTS["strain_saturation"]
# made by a diagnosis, which takes most of a second
LONG = {
    "something_left",
    "input_noise",
    "gaps",
    "absent_input",
    "fmu_failed",
    "exchanged",
    "excitation_below_noise",
    "other_clock",
    "unsigned",
    "other_sign",
    "runs_ahead",
    "not_in_all_samples",
    "straight_part",
    "other_unit",
    "implausible",
    "other_specimen",
    "intersample_contradicted",
    "not_followed",
    "resampled",
    "not_simulated",
}
MAKERS: dict[NoteCode, Maker] = {}


def as_it_is(fitted, below):
    """Report a model as it is."""
    return fitted


def makes(*codes: NoteCode) -> Callable[[Maker], Maker]:
    """Register what makes notes of these codes, once for all of them."""

    def register(maker: Maker) -> Maker:
        made: list[Note] = []

        def once(monkeypatch: pytest.MonkeyPatch) -> list[Note]:
            made.extend([] if made else maker(monkeypatch))
            return made

        MAKERS.update(dict.fromkeys(codes, once))
        return maker

    return register


def with_output(data: Dataset, output: str, values: np.ndarray) -> Dataset:
    return replace(data, measured={**data.measured, output: values})


def faults(data: Dataset) -> list[Note]:
    return list(map(note_of, assess(data.channels)[1]))


class Relaxing(Component):
    """A store that empties by itself."""

    name = "relaxing"
    constant = Parameter(2.0, "s", min=1e-3)
    level = State("1", rate="flow", start=1.0)

    def flow(self):
        return -self.level / self.constant

    @Output("1")
    def y(self):
        return self.level


def relaxing() -> Dataset:
    """Such a store, measured."""
    time = 0.05 * np.arange(400)
    return Dataset(time, {}, {"y": 1.5 * np.exp(-time / 3.0) + 1e-3 * coloured(0.0, 1, 400)})


class Product(Component):
    """What is fed, times two factors."""

    name = "product"
    a = Parameter(1.0, "1", min=0, max=5.0)
    b = Parameter(1.0, "1", min=0)
    u = Input("1")

    @Output("1")
    def y(self):
        return self.a * self.b * self.u


def products(factor: float) -> Dataset:
    """What is fed, times a factor, measured."""
    time = 0.1 * np.arange(600)
    u = np.where(np.floor(time / 5.0) % 2 == 0.0, 1.0, -0.6)
    return Dataset(time, {"u": u}, {"y": factor * u + 0.01 * coloured(0.0, 1, 600)})


OFFSET = sensor_offset(Product, "y")


def with_offset() -> Dataset:
    """Such a record, whose sensor shows too much."""
    data = products(2.0)
    return with_output(data, "y", data.measured["y"] + 0.3)


# --- faults of the data
# ---------------------------------------------------------------------------------------------


@makes(NoteCode.CLIPPED)
def clipped(monkeypatch):
    data = short_record()
    return faults(with_output(data, "voltage", np.clip(data.measured["voltage"], -0.8, 0.8)))


def wave() -> Dataset:
    """An output without noise."""
    time = 0.1 * np.arange(2000)
    return Dataset(time, {"u": np.sin(0.3 * time)}, {"y": np.sin(0.3 * time)})


@makes(NoteCode.CLIPPED_REPEATEDLY)
def clipped_repeatedly(monkeypatch):
    return faults(with_output(wave(), "y", np.clip(wave().measured["y"], -1.0, 0.7)))


def standing_still(data: Dataset, output: str, first: int, last: int) -> list[Note]:
    values = data.measured[output].copy()
    values[first:last] = values[first]
    return faults(with_output(data, output, values))


@makes(NoteCode.STUCK)
def stuck(monkeypatch):
    return standing_still(short_record(), "displacement", 500, 700)


@makes(NoteCode.STANDS_STILL)
def stands_still(monkeypatch):
    """A plant with a dead zone, pushed more and more."""
    time = 0.1 * np.arange(2000)
    pushed = time / time[-1] * np.sin(0.3 * time)
    moved = np.sign(pushed) * np.maximum(np.abs(pushed) - 0.7, 0.0)
    return faults(Dataset(time, {"u": pushed}, {"y": moved}))


@makes(NoteCode.STUCK_WHILE_DRIVEN)
def stuck_while_driven(monkeypatch):
    return standing_still(wave(), "y", 800, 1000)


@makes(NoteCode.DEAD_TO_THE_END, NoteCode.UNUSABLE)
def dead_to_the_end(monkeypatch):
    return standing_still(short_record(), "displacement", 100, 1500)


@makes(NoteCode.DEAD_WHILE_DRIVEN)
def dead_while_driven(monkeypatch):
    return standing_still(wave(), "y", 1500, 2000)


@makes(NoteCode.DEAD_CONSTANT, NoteCode.NOTHING_USABLE)
def dead_constant(monkeypatch):
    data = short_record()
    return faults(replace(data, measured={"voltage": np.zeros(data.time.size)}))


@makes(NoteCode.DEAD_TOGGLING)
def dead_toggling(monkeypatch):
    data = short_record()
    return faults(
        with_output(data, "voltage", 1e-3 * np.random.default_rng(1).integers(0, 2, data.time.size))
    )


@makes(NoteCode.OUTLIERS)
def far_out(monkeypatch):
    data = short_record()
    moved = np.any(
        [
            np.convolve(np.diff(u, prepend=u[0]) != 0.0, np.ones(5), "same")
            for u in data.inputs.values()
        ],
        0,
    )
    values = data.measured["displacement"].copy()
    values[np.flatnonzero(~moved)[20]] += 2e-4
    return faults(with_output(data, "displacement", values))


@makes(NoteCode.QUANTISED)
def quantised(monkeypatch):
    data = short_record()
    return faults(with_output(data, "voltage", np.round(data.measured["voltage"] / 0.05) * 0.05))


# --- what is left
# --------------------------------------------------------------------------------------------------


def left(clean: Clean) -> list[Note]:
    """Notes on what a perfect model leaves."""
    return list(residual_notes({"y": analysed(clean)}))


@makes(NoteCode.SOMETHING_LEFT)
def something_left(monkeypatch):
    """A voltage that wanders, beside a strain that saturates."""
    data = short_record("strain_saturation")
    wander = 2e-3 * np.cumsum(coloured(0.0, 5, data.time.size))
    return diagnose(
        PpyActuator, with_output(data, "voltage", data.measured["voltage"] + wander), [SATURATION]
    ).notes


@makes(NoteCode.OUTLYING_RESIDUALS)
def outlying_residuals(monkeypatch):
    return left(clean(0, outliers()))


@makes(NoteCode.VARYING_NOISE)
def varying_noise(monkeypatch):
    return left(clean(0, growing_with_size()))


@makes(NoteCode.FEEDBACK)
def feedback(monkeypatch):
    return left(controlled(0, gaussian(), 2.0, 1))


# --- how far the data reach
# -----------------------------------------------------------------------------------------


@makes(NoteCode.CONSTANT_INPUT, NoteCode.NO_EXCITATION)
def constant_inputs(monkeypatch):
    data = short_record()
    return faults(
        replace(data, inputs={name: np.full_like(u, 0.5) for name, u in data.inputs.items()})
    )


@makes(NoteCode.FREE_RESPONSE)
def free_response(monkeypatch):
    return diagnose(Relaxing, relaxing(), []).notes


@makes(NoteCode.EXCITATION_BELOW_NOISE)
def jitter(monkeypatch):
    data = short_record()
    inputs = {
        name: 0.5 + 1e-5 * coloured(0.0, k, u.size)
        for k, (name, u) in enumerate(data.inputs.items())
    }
    noise = {name: 1e-3 * np.ptp(y) * coloured(0.0, 7, y.size) for name, y in data.measured.items()}
    return diagnose(PpyActuator, Dataset(data.time, inputs, noise), []).notes


@makes(NoteCode.ABSENT_INPUT)
def absent_input(monkeypatch):
    record = rig_record(None, "current", "voltage")
    return pipeline.diagnose(
        record, find_model("ppy_actuator"), options=pipeline.DiagnosisOptions(effects=[])
    ).notes


def with_gaps(step: int, output: str = "voltage") -> Dataset:
    """Of an output only every so many samples, or all but those."""
    data = short_record()
    values = np.full(data.time.size, np.nan)
    values[::step] = data.measured[output][::step]
    return with_output(data, output, values)


@makes(NoteCode.TOO_FEW_SAMPLES)
def too_few_samples(monkeypatch):
    return screened(PpyActuator, with_gaps(150), {})[1]


@makes(NoteCode.GAPS)
def gaps_in_time(monkeypatch):
    record = rig_record()
    kept = np.r_[0:500, 600:620, 700:1500]
    record = replace(
        record, time=record.time[kept], signals={n: v[kept] for n, v in record.signals.items()}
    )
    return pipeline.diagnose(
        record, find_model("ppy_actuator"), options=pipeline.DiagnosisOptions(effects=[])
    ).notes


@makes(NoteCode.MANY_GAPS)
def many_gaps(monkeypatch):
    return screen_and_divide(PpyActuator, with_gaps(2), None, {}).notes


@makes(NoteCode.ENDS_EARLY)
def ends_early(monkeypatch):
    data = short_record()
    values = data.measured["voltage"].copy()
    values[80:] = np.nan
    return drop_truncated(with_output(data, "voltage", values))[1]


@makes(NoteCode.NOT_IN_VALIDATION_DATA)
def not_in_validation_data(monkeypatch):
    return screen_and_divide(
        PpyActuator, short_record(), short_record().only(["voltage"]), {}
    ).notes


@makes(NoteCode.INTERSAMPLE)
def intersample(monkeypatch):
    return diagnose(PpyActuator, record("chirp", False, 1), []).notes


@makes(NoteCode.INTERSAMPLE_OPEN)
def intersample_open(monkeypatch):
    data = record("multisine", False, 2, duration=40.0, outputs=("voltage",), noise=3.0)
    return diagnose(PpyActuator, data, [], held=PpyActuator.layout.start_parameters).notes


@makes(NoteCode.INTERSAMPLE_CONTRADICTED)
def intersample_contradicted(monkeypatch):
    return diagnose(PpyActuator, replace(short_record(), linear=True), []).notes


@makes(NoteCode.SEARCHED_IN_PART)
def searched_in_part(monkeypatch):
    monkeypatch.setattr(stretch, "LONG", 500)
    monkeypatch.setattr(stretch, "_SIZES", (400,))
    return diagnose(PpyActuator, short_record(), []).notes


@makes(NoteCode.EVEN_CLOCK)
def even_clock(monkeypatch):
    data = record("chirp", False, 1)
    return diagnose(
        PpyActuator, replace(data, time=data.time + 0.01 * coloured(0.0, 3, data.time.size)), []
    ).notes


@makes(NoteCode.INPUT_NOISE, NoteCode.INPUT_NOISE_DOES_THE_SAME)
def input_noise(monkeypatch):
    data = record("triangle", False, 3, force="multilevel", input_noise=0.005)
    lag = sensor_lag(PpyActuator, "voltage")
    return diagnose(PpyActuator, data, [lag], held=PpyActuator.layout.start_parameters).notes


# --- effects
# --------------------------------------------------------------------------------------------------


@makes(NoteCode.NO_TRACE)
def no_trace(monkeypatch):
    return diagnose(PpyActuator, short_record().only(["voltage"]), [SATURATION]).notes


@makes(NoteCode.UNIDENTIFIABLE)
def unidentifiable(monkeypatch):
    data = short_record().only(["displacement"])
    return diagnose(PpyActuator, data, [sensor_gain(PpyActuator, "displacement")]).notes


@makes(NoteCode.NOT_SIMULATED)
def not_simulated(monkeypatch):
    monkeypatch.setattr(scoring, "score_directions", lambda _, effects, __: [(effects[0], None)])
    monkeypatch.setattr(scoring, "simulated_directions", fails)
    return diagnose(PpyActuator, short_record(), [SATURATION]).notes


@makes(NoteCode.NOT_IN_ALL_SAMPLES)
def not_in_all_samples(monkeypatch):
    found = diagnose(Product, with_offset(), [OFFSET]).selection
    return all_samples.dropped_notes(found, replace(found, steps=[]))


@makes(NoteCode.NOT_VALIDATED)
def not_validated(monkeypatch):
    """What is held out is just what the model without the effect says."""
    diagnosis = diagnose(Product, with_offset(), [OFFSET])
    validation = diagnosis.validation
    exact = predict(validation, diagnosis.selection.base).simulated
    judged_by = ValidationData(
        replace(validation.data, measured=exact), validation.judged, validation.continued
    )
    return confirm(diagnosis.selection, judged_by, as_it_is).notes


@makes(NoteCode.MAY_BE_NEUTRAL)
def may_be_neutral(monkeypatch):
    """Take an effect that is sure for one that is not, and that is not needed."""
    monkeypatch.setattr(final_model, "ACCEPT", np.inf)
    monkeypatch.setattr(
        final_model, "undetermined_effects", lambda model, _: [*model.candidate.effects]
    )
    monkeypatch.setattr(final_model, "free_run_gain", lambda *arguments: FreeRunGain())
    return diagnose(Product, with_offset(), [OFFSET]).notes


@makes(NoteCode.CONFOUNDED)
def confounded(monkeypatch):
    monkeypatch.setattr(conclusion, "CONFOUNDED_SHARE", 0.0)
    return diagnose(Product, with_offset(), [OFFSET, sensor_drift(Product, "y")]).notes


# --- results
# --------------------------------------------------------------------------------------------------


def fails(*arguments: Any) -> Any:
    raise UserError("for a reason")


@makes(NoteCode.UNDETERMINED)
def undetermined(monkeypatch):
    return diagnose(PpyActuator, short_record().only(["voltage"]), []).notes


@makes(NoteCode.DETERMINED_TOGETHER)
def determined_together(monkeypatch):
    return diagnose(Product, products(2.0), []).notes


@makes(NoteCode.STRAIGHT_PART)
def straight_part(monkeypatch):
    """What is rough in one direction only is half a slope, and half what comes on top of that."""
    signal = coloured(0.5, 2, 600)
    shown = GAIN * signal + np.maximum(signal, 0.0) + SPREAD * coloured(0.0, 1, 600)
    data = Dataset(STEP * np.arange(600), {"signal": signal}, {"shown": shown})
    diagnosis = diagnose(Amplifier, data, [ASYMMETRY])
    assert diagnosis.estimates["gain"].value == pytest.approx(GAIN + 0.5, rel=0.01)
    assert diagnosis.causes == [ASYMMETRY.id]
    assert diagnosis.changed == []
    return diagnosis.notes


@makes(NoteCode.AT_BOUND)
def at_bound(monkeypatch):
    return diagnose(Product, products(20.0), [], held=["b"]).notes


@makes(NoteCode.NOT_CONVERGED)
def not_converged(monkeypatch):
    fitted = Search(products(2.0), Product, ["a"]).nominal()
    return identifiability_notes(replace(fitted, fit=replace(fitted.fit, converged=False)), ["a"])


@makes(NoteCode.NOT_MOVED)
def not_moved(monkeypatch):
    """What is fed is nothing, and so the factors do nothing."""
    data = products(2.0)
    return diagnose(Product, replace(data, inputs={"u": np.zeros(data.time.size)}), []).notes


@makes(NoteCode.IMPLAUSIBLE)
def implausible(monkeypatch):
    data = short_record().only(["voltage"])
    return diagnose(
        PpyActuator, with_output(data, "voltage", 1e3 * data.measured["voltage"]), []
    ).notes


@makes(NoteCode.NOT_FOLLOWED)
def not_followed(monkeypatch):
    fitted, others = several("ab"), several("cd", R0=0.06)
    return diagnose(Cell, fitted, [], holdout=others).notes


@makes(NoteCode.LARGE_ERROR)
def large_error(monkeypatch):
    data = products(1.0)
    shown = data.measured["y"] + 0.3 * coloured(0.9, 1, 600)
    return diagnose(Product, with_output(data, "y", shown), []).notes


@makes(NoteCode.UNRELATED)
def unrelated(monkeypatch):
    return diagnose(
        Product, with_output(products(1.0), "y", 5.0 * coloured(0.98, 1, 600)), []
    ).notes


@makes(NoteCode.SOLVER_ERROR)
def solver_error(monkeypatch):
    time = 0.1 * np.arange(600)
    u = np.sin(time) + np.sin(0.37 * time)
    nearly = Dataset(time, {"u": u}, {"y": u + 1e-3 * u**3})
    return diagnose(Product, nearly, []).notes


@makes(NoteCode.EXCHANGED)
def exchanged(monkeypatch):
    return diagnose(Motor, wired(exchanged=True), []).notes


def of_gain(change: Callable[[np.ndarray], np.ndarray]) -> list[Note]:
    """Diagnose a static gain on a record of which the output was changed."""
    rng = np.random.default_rng(5)
    u = np.convolve(rng.standard_normal(640), np.hanning(41) / 20.0, "valid")
    shown = change(2.0 * u + 0.002 * rng.standard_normal(600))
    return diagnose(Product, Dataset(0.1 * np.arange(600), {"u": u}, {"y": shown}, ["u"]), []).notes


@makes(NoteCode.DIFFERENTIATED)
def differentiated(monkeypatch):
    return of_gain(lambda y: np.diff(y, prepend=y[0]) / 0.1)


@makes(NoteCode.INTEGRATED)
def integrated(monkeypatch):
    return of_gain(lambda y: 0.1 * np.cumsum(y))


@makes(NoteCode.MOVES_AHEAD)
def moves_ahead(monkeypatch):
    data = products(1.0)
    smooth = sosfiltfilt(butter(4, 0.2, output="sos"), data.measured["y"])
    return list(map(note_of, ahead_of_inputs(with_output(data, "y", smooth).channels)))


@makes(NoteCode.FILTERED)
def filtered(monkeypatch):
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(-1.0, 1.0, 100), 10)
    smooth = sosfiltfilt(butter(4, 0.08, output="sos"), 2.0 * u)
    return diagnose(Product, Dataset(0.1 * np.arange(1000), {"u": u}, {"y": smooth}), []).notes


@makes(NoteCode.RUNS_AHEAD)
def runs_ahead(monkeypatch):
    data = wired()
    shown = np.append(data.measured["shown"][40:], np.zeros(40))
    monkeypatch.setattr(diagnosing, "ahead_of_inputs", lambda data: [])
    return diagnose(Motor, with_output(data, "shown", shown), []).notes


@makes(NoteCode.OTHER_CLOCK)
def other_clock(monkeypatch):
    data = wired()
    shown = np.interp(data.time / 1.03, data.time, data.measured["shown"])
    return diagnose(Motor, with_output(data, "shown", shown), []).notes


@makes(NoteCode.UNSIGNED)
def unsigned(monkeypatch):
    data = wired()
    return diagnose(Motor, with_output(data, "shown", np.abs(data.measured["shown"])), []).notes


def cut_motor(gain: float) -> list[Note]:
    """Diagnose a record without 200 samples, after which the motor has so many times the gain."""
    data = wired(noise=1e-3)
    after = np.arange(len(data.time)) >= 600
    shown = np.where(after, gain, 1.0) * data.measured["shown"]
    kept = np.delete(np.arange(len(shown)), np.s_[400:600])
    part = with_output(data, "shown", shown).where(kept)
    return diagnose(Motor, replace(part, time=data.time[: len(kept)]), []).notes


@makes(NoteCode.PIECED)
def pieced(monkeypatch):
    return cut_motor(1.0)


@makes(NoteCode.OTHER_SPECIMEN)
def other_specimen(monkeypatch):
    return cut_motor(2.0)


@makes(NoteCode.OVERSAMPLED)
def oversampled(monkeypatch):
    return list(map(note_of, without_oversampling(Channels(wave().time, {}, wave().measured))[1]))


@makes(NoteCode.COPIED)
def copied(monkeypatch):
    data = short_record()
    return faults(with_output(data, "voltage", data.inputs["current"]))


@makes(NoteCode.OTHER_SIGN)
def other_sign(monkeypatch):
    return diagnose(Motor, wired(drive_sign=-1.0), []).notes


@makes(NoteCode.RESAMPLED)
def resampled_record(monkeypatch):
    data = wired()
    index = np.arange(5 * (len(data.time) - 1) + 1) / 5.0

    def lines(values):
        return np.interp(index, np.arange(len(data.time)), values)

    inputs = {"drive": lines(data.inputs["drive"])}
    shown = {"shown": lines(data.measured["shown"])}
    return diagnose(Motor, Dataset(lines(data.time), inputs, shown), []).notes


@makes(NoteCode.OTHER_UNIT)
def other_unit(monkeypatch):
    return diagnose(Motor, wired(drive_sign=1e3), []).notes


@makes(NoteCode.END_NOT_FOLLOWED)
def end_not_followed(monkeypatch):
    data = products(1.0)
    return diagnose(
        Product,
        with_output(data, "y", np.where(data.time < 40.0, 1.0, 2.0) * data.measured["y"]),
        [],
    ).notes


@makes(NoteCode.NO_GAIN)
def no_gain(monkeypatch):
    monkeypatch.setattr(conclusion, "DEGRADED", 0.0)
    return diagnose(Product, with_offset(), [OFFSET]).notes


@makes(NoteCode.FMU_FAILED)
def fmu_failed(monkeypatch):
    monkeypatch.setattr(pipeline, "measure_gain", fails)
    return pipeline.diagnose(
        rig_record(), find_model("ppy_actuator"), options=pipeline.DiagnosisOptions(effects=[])
    ).notes


@makes(NoteCode.NO_EXPERIMENT)
def no_experiment(monkeypatch):
    """Nothing moves: an experiment is designed that would tell something."""
    monkeypatch.setattr(pipeline, "design_experiment", fails)
    record = rig_record()
    rng = np.random.default_rng(1)
    still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
    noise = {name: 1e-5 * rng.standard_normal(len(record.time)) for name in record.signals}
    record = replace(record, signals=noise | still)
    return pipeline.diagnose(
        record, find_model("ppy_actuator"), options=pipeline.DiagnosisOptions(effects=[])
    ).notes


@makes(NoteCode.NOT_REFITTED)
def not_refitted(monkeypatch):
    monkeypatch.setattr(conclusion.Search, "refit", fails)
    return diagnose(PpyActuator, short_record(), []).notes


@makes(NoteCode.TIME_SPENT)
def time_spent(monkeypatch):
    return diagnose(PpyActuator, short_record(), [SATURATION], budget=Budget(1e-9)).notes


# --- sentences
# --------------------------------------------------------------------------------------------------


def other(fact: Any) -> Any:
    """Another fact of the same kind."""
    if isinstance(fact, str):
        return f"another {fact}"
    if isinstance(fact, tuple):
        return (*fact, other(fact[-1])) if fact else ("another",)
    return {"another": 0.99} if isinstance(fact, dict) else 2 * fact + 1


@pytest.mark.parametrize(
    "code", slow_but(NoteCode, *(code for code in NoteCode if code not in LONG))
)
def test_every_note_has_a_sentence_with_all_its_facts(code, monkeypatch):
    note = next(note for note in MAKERS[code](monkeypatch) if note.code is code)
    sentence = wording.message(note)
    assert not re.search(r"\{\w*\}", sentence)  # nothing is left to be filled in
    assert note.subject in sentence
    template = FAULTS[code].sentence if code in FAULTS else wording._NOTES[code]
    named = {name for _, name, _, _ in Formatter().parse(template) if name}
    needed = named - {"subject", *wording._options(note.subject)}  # options are no facts
    assert needed <= set(note.facts)
    for name in needed:
        changed = replace(note, facts={**note.facts, name: other(note.facts[name])})
        assert wording.message(changed) != sentence, f"{name} is not in it"
    assert wording.message(note.of_holdout()) == f"in the record held out: {sentence}"


def test_every_code_and_every_verdict_has_its_words():
    assert {*wording._NOTES, *FAULTS} == set(NoteCode)
    assert not wording._NOTES.keys() & FAULTS.keys()
    assert set(wording._VERDICTS) == set(Verdict)


@pytest.mark.parametrize(
    ("gains", "why"),
    [
        ([50.0, 2.0], "alone it lowers BIC by 50.0; beside a it is not needed"),
        ([3.0], "too little: 10 would be evidence"),
        ([-3.0], "it explains less than its parameters cost"),
        ([99.0], "b explains the record much better"),
    ],
)
def test_why_an_effect_is_not_named(gains, why):
    assert wording.why_not(gains, "a", rival="b") == why


def test_where_there_is_no_rival_none_is_named():
    assert wording.why_not([99.0], "").startswith("no likelier in noise of its own")


def test_evidence_that_varying_noise_takes_away_is_no_matter_of_another_effect():
    assert (
        wording.why_not([50.0], "", unsure=True)
        == "too unsure: noise of a varying level can do as much"
    )
    assert (
        wording.why_not([50.0, 3.0], "a", unsure=True)
        == "alone it lowers BIC by 50.0; beside a it is not needed"
    )


# --- what must be known to read a verdict
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def actuator():
    return find_model("ppy_actuator")


def test_a_record_that_tells_all_needs_no_more_words(actuator):
    result = pipeline.diagnose(rig_record(), actuator, options=NOTHING)
    assert str(wording.headline(result)) == wording.sentence(result.diagnosis)


def test_what_is_held_is_no_reservation(actuator):
    known = ("alpha", "k1", "b1", "k2", "b2", "kelvin_elongation_start", "maxwell_elongation_start")
    options = pipeline.DiagnosisOptions({"force": 0.7}, effects=[], hold=known)
    result = pipeline.diagnose(rig_record(None, "current", "voltage"), actuator, options=options)
    assert str(wording.headline(result)) == wording.sentence(result.diagnosis)


def test_ratios_out_of_all_reason_are_in_the_headline(actuator):
    record = rig_record(None, "current", "force", "voltage")
    record = replace(record, signals=record.signals | {"voltage": 1e3 * record.signals["voltage"]})
    headline = str(wording.headline(pipeline.diagnose(record, actuator, options=NOTHING)))
    assert headline.lower().count("out of all reason: ") == 1
    assert "R1 times " in headline


@pytest.mark.parametrize(
    ("margin", "said"), [(2e-5, False), (-2e-5, False), (12.0, True), (-3.0, True)]
)
def test_a_difference_that_is_none_is_not_told_as_one(margin, said):
    facts = {"course": "linear", "basis": "course", "margin": margin}
    assert ("BIC" in wording.message(Note(NoteCode.INTERSAMPLE, "current", facts))) is said


@pytest.mark.parametrize("asked", [True, False])
def test_an_input_that_is_forced_against_its_course_is_in_the_headline(actuator, asked):
    """The rig holds its inputs between samples."""
    result = pipeline.diagnose(
        rig_record(), actuator, options=pipeline.DiagnosisOptions(effects=[], interpolate=asked)
    )
    assert ("its course is one of steps" in str(wording.headline(result))) is asked


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (0.10, 0.05, "falls from 10.0 % to 5.0 %"),
        (0.00704, 0.00698, "falls from 0.704 % to 0.698 %"),
        (0.100001, 0.099999, "falls from 10.0001 % to 9.9999 %"),
        (0.05, 0.0502, "goes from 5.00 % to 5.02 %"),
        (0.05, 0.05, "stays at 5.0 %"),
        (0.05, 0.05 * (1.0 - 1e-9), "stays at 5.0 %"),
    ],
)
def test_two_errors_are_told_with_as_many_digits_as_tell_them_apart(before, after, told):
    assert wording.format_move(before, after) == told


def test_an_error_and_an_interval_that_are_no_numbers_are_words():
    assert wording.format_error(0.12345) == "12.3 %"
    assert [wording.format_error(e) for e in (np.nan, np.inf)] == ["–", "–"]
    assert wording.format_interval((1.0, 2.0), "{:.1f}".format) == "1.0 … 2.0"
    for open_one in ((-np.inf, np.inf), (0.0, np.inf)):
        assert wording.format_interval(open_one, str) == "not determined"
