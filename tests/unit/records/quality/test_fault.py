"""A fault is told in one sentence with its figures, and the sentence begins with its channel."""

from __future__ import annotations

from string import Formatter

import numpy as np
import pytest

from orchestration.records.quality import FAULTS, Channels, Fault

FIGURES = {
    "end": "maximum",
    "input": "current",
    "level": 0.8,
    "resolution": 0.05,
    "value": 0.5,
    "usable": 0.04,
    "share": 0.125,
    "samples": 200,
    "times": 10,
    "count": 3,
}


def test_a_sentence_has_the_channel_and_its_figures():
    fault = Fault("clipped", "voltage", {"end": "maximum", "level": 0.8, "share": 0.125})
    assert fault.sentence == "voltage: cut off at its maximum 0.8, 12.5 % of the samples"
    assert Fault("nothing_usable").sentence.startswith("no output is left")


@pytest.mark.parametrize("code", FAULTS)
def test_every_figure_of_a_fault_is_in_its_sentence(code):
    named = {name for _, name, _, _ in Formatter().parse(FAULTS[code].sentence) if name}
    plain = Fault(code, "voltage", FIGURES).sentence
    for name in named:
        other = "minimum" if isinstance(FIGURES[name], str) else 7
        assert Fault(code, "voltage", FIGURES | {name: other}).sentence != plain


def test_evidence_is_used_and_faults_are_not():
    kinds = {code for code in FAULTS if Fault(code).is_evidence}
    assert kinds == {"quantised", "stands_still", "constant_input", "no_excitation"}


def test_samples_are_even_by_their_times_alone():
    for time, even in ((0.1 * np.arange(9), True), (np.arange(9.0) ** 2, False)):
        assert Channels(time, {}, {}).is_even is even


def test_a_file_is_not_believed_if_a_column_was_copied_or_is_ahead():
    assert {code for code in FAULTS if Fault(code).discredits} == {"copied", "moves_ahead"}
