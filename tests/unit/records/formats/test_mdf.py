"""Claims: channels of an MDF 4 file keep their units and instants, also slower ones."""

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.record_forms import SIGNALS, refusal

asammdf = pytest.importorskip("asammdf")


def test_fast_and_slow_channels_keep_their_instants(tmp_path):
    fast, slow = 0.1 * np.arange(100), 1.0 * np.arange(10)
    path = tmp_path / "r.mf4"
    with asammdf.MDF(version="4.10") as file:
        for name, time, values, unit in (
            ("current", fast, 1e3 * np.sin(fast), "mA"),
            ("displacement", slow, np.cos(slow), "m"),
        ):
            file.append(asammdf.Signal(values, time, unit=unit, name=name))
        file.save(path)
    record = read_record(path, SIGNALS)
    np.testing.assert_allclose(record.time, fast, atol=1e-9)
    np.testing.assert_allclose(record.signals["current"], np.sin(fast), rtol=1e-12)
    measured = np.isfinite(record.signals["displacement"])
    np.testing.assert_allclose(record.time[measured], slow, atol=1e-9)
    np.testing.assert_allclose(record.signals["displacement"][measured], np.cos(slow))


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / "r.mf4").write_bytes(b"MDF     4.10    " + bytes(200))
    message = refusal(tmp_path / "r.mf4")
    assert "the MDF file is damaged" in message
    assert "BytesIO" not in message
