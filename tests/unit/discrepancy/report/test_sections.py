"""Claims: the sections of a report show what was diagnosed, and nothing else."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.titles import effect_title, within_sentence
from fmus.ppy_actuator.effects import EFFECTS
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report.page import diagnosis_page
from tests.support.pages import words_of
from tests.support.report_results import COMMAND, FEW, with_verdict

pytestmark = pytest.mark.slow  # each test needs a diagnosis


def test_an_uneven_record_is_told_and_drawn_without_holes(results, made):
    diagnosis = results["uneven"].diagnosis
    there = np.isfinite(diagnosis.validation.data.measured["voltage"])
    assert (
        f"every third sample was held out: fitted to {(~there).sum()}, judged on {there.sum()}."
        in words_of(made["uneven"])
    )
    assert "Only samples that were held out are shown." in words_of(made["uneven"])


def test_errors_are_those_of_the_diagnosis(results, made):
    diagnosis = results["cause"].diagnosis
    text = words_of(made["cause"])
    for output in ("voltage", "displacement"):
        missing = re.search(
            rf" {output.capitalize()} as it is ([\d.]+) % .*? refitted ([\d.]+) % .*? effect"
            r" ([\d.]+) % · (\S+) (\S+)",
            text,
        )
        assert float(missing[2]) == pytest.approx(100.0 * diagnosis.before[output], rel=2e-2)
        assert float(missing[3]) == pytest.approx(100.0 * diagnosis.after[output], rel=2e-2)
        y = diagnosis.validation.data.measured[output][diagnosis.validation.first :]
        size = diagnosis.after[output] * np.std(y) * {"mV": 1e3, "µm": 1e6}[missing[5]]
        assert float(missing[4]) == pytest.approx(size, rel=5e-3)


def test_evidence_is_told_once_for_every_effect(results, made):
    diagnosis = results["cause"].diagnosis
    text = words_of(made["cause"])
    step = diagnosis.selection.steps[0]
    title = "Strain that levels off at large charge strain_saturation"
    assert f"{title} Elongation that levels off" in text
    assumed = "elongation is proportional to charge, and the load does not change the voltage"
    where = r"\(assumption 5 of its documentation\)"
    known = rf"the model assumes that {assumed} {where} {step.gain:.1f} .*? named"
    assert re.search(known, text)
    fitted = {e.effect_name for e, _ in (*step.rejected, *diagnosis.selection.rejected)}
    evidence = text.split("Evidence: what was tried")[1].split(" Parameters ")[0]
    assert evidence.count(" rejected ") == len(fitted)
    assert re.search(
        r"lowers BIC by [\d.]+; beside strain that levels off at large charge it is not needed",
        evidence,
    )
    of_few = {name for name, effect in EFFECTS.items() if effect.id in {few.id for few in FEW}}
    missing = of_few - fitted - {"strain_saturation"}
    told = re.search(r"not fitted: (.*?)\.", evidence)
    titles = {within_sentence(effect_title(EFFECTS[name])) for name in missing}
    assert set(told[1].split(", ") if told else ()) == titles
    assert " not told apart from strain that levels off" in words_of(made["ambiguous"])


def test_what_is_confirmed_stands_above_what_is_refuted(made):
    """The ideas that were not needed are folded up below it."""
    evidence = made["cause"].split("Evidence: what was tried")[1].split("<h3>Parameters")[0]
    above, folded = evidence.split("<details>")
    assert 'chip named">named' in above
    assert "rejected" not in above
    assert "rejected" in folded
    assert "named<" not in folded


def test_notes_are_grouped_by_what_to_do(results):
    notes = [
        Note(NoteCode.NO_TRACE, "slack"),
        Note(NoteCode.AT_BOUND, "", {"names": ("R1",)}),
        Note(NoteCode.UNDETERMINED, "", {"names": ("k_2",)}),
    ]
    text = words_of(diagnosis_page(replace(results["cause"], notes=notes), COMMAND).html())
    todo, sure = text.split(" How sure this is ")
    assert "Check columns, units, signs and clocks R1 ended at an end" in todo
    assert "Set, hold or choose what you know The record does not determine k_2" in todo
    assert "Nothing to do, but good to know Slack was not judged" in sure


def test_a_note_calls_an_effect_by_its_title_and_has_its_identifier_behind(results):
    result = results["cause"]
    effect = next(effect for effect in result.effects if effect.title and not effect.output)
    notes = [Note(NoteCode.NO_TRACE, effect.id)]
    text = words_of(diagnosis_page(replace(result, notes=notes), COMMAND).html())
    assert (
        f"{effect.title} was not judged: it leaves no trace in what was measured {effect.id}"
        in text
    )


def test_parameters_have_intervals_and_marks(results, made):
    diagnosis = results["cause"].diagnosis
    rows = re.findall(r"<tr>(.*?)</tr>", made["cause"])
    rows = {
        name: row for name in diagnosis.estimates for row in rows if f'class="id">{name}<' in row
    }
    assert set(rows) == {name for name in diagnosis.estimates if not name.endswith("_start")}
    assert {name for name, row in rows.items() if "chip differs" in row} == set(diagnosis.changed)
    e = diagnosis.estimates["R1"]
    low, high = map(float, re.search(r'muted">([\d.]+) … ([\d.]+) mΩ<', rows["R1"]).groups())
    assert (1e-3 * low, 1e-3 * high) == pytest.approx(e.interval, rel=1e-3)
    assert f"{e.value / 0.43 - 1.0:+.1%}"[1:-1] in rows["R1"]


def test_what_is_left_and_not_judged_is_told(made):
    text = words_of(made["unexplained"])
    assert "A line at 0.83 Hz with an amplitude of 4.00 mV." in text
    assert text.count("A jump of 100 µm at 10") == 5
    assert "2 more jumps." in text
    assert "good to know Slack was not judged: it leaves no trace in what was measured" in text
    assert "neither a cause nor a parameter can be judged" in words_of(made["idle"])
    assert "Current stays at 0.5 A; force stays at 0.5 N." in words_of(made["idle"])


def test_uneven_samples_have_no_spectrum(results):
    cause, estimation = results["cause"], results["cause"].diagnosis.estimation
    time = estimation.time[-1] * (estimation.time / estimation.time[-1]) ** 3
    text = diagnosis_page(
        with_verdict(cause, Verdict.CAUSE, estimation=replace(estimation, time=time)), COMMAND
    ).html()
    assert "Sampling is uneven" in text
    assert "density [" not in text


def test_repairs_are_told(results, made):
    repairs = results["cause"].record.repairs
    assert repairs
    text = words_of(made["cause"])
    assert all(repair.message in text for repair in repairs)
