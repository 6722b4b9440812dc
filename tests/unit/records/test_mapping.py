"""Claims: a signal is found in a system's result by the name behind the member's, where that is
clear.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import read_record, write_record

TIME = 0.1 * np.arange(50)
SIGNALS = {"current": "A", "voltage": "V"}


@pytest.fixture
def written(tmp_path):
    def write(*names):
        values = {name: np.sin((k + 1.0) * TIME) for k, name in enumerate(names)}
        write_record(tmp_path / "r.csv", TIME, values, dict.fromkeys(names, "V") | {"current": "A"})
        return tmp_path / "r.csv", values

    return write


def test_the_only_column_of_a_member_is_taken_and_told(written):
    path, values = written("current", "proxy.voltage", "proxy.voltage_age")
    record = read_record(path, SIGNALS)
    assert record.signals["voltage"] == pytest.approx(values["proxy.voltage"])
    messages = [repair.message for repair in record.repairs if not repair.changed_data]
    assert (
        "column 'proxy.voltage' is read as voltage: the only one of a member of this name"
        in messages
    )


def test_a_column_of_the_very_name_goes_first(written):
    path, values = written("current", "proxy.voltage", "voltage")
    assert read_record(path, SIGNALS).signals["voltage"] == pytest.approx(values["voltage"])


def test_what_the_user_says_goes_first(written):
    path, values = written("current", "proxy.voltage", "cell")
    record = read_record(path, SIGNALS, mapping={"cell": "voltage"})
    assert record.signals["voltage"] == pytest.approx(values["cell"])


def test_two_members_are_no_choice_for_a_program_to_make(written):
    path, _ = written("current", "one.voltage", "two.voltage")
    assert list(read_record(path, SIGNALS).signals) == ["current"]
    with pytest.raises(UserError, match="the signal 'voltage'"):
        read_record(path, SIGNALS, required=["voltage"])
