"""Claims: where an oscilloscope states start and increment, they are the time; where its settings
stand beside the data, these are read and those are not.
"""

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.record_forms import refusal, write

COUNT = 20
VALUES = np.round(0.01 * np.arange(COUNT), 6)
RIGOL = "X,CH1,Start,Increment,\nSequence,Volt,-6.0e-03,1.0e-05,\n" + "".join(
    f"{k},{value:.6e},\n" for k, value in enumerate(VALUES)
)
RIGOL_4 = "Time(s),CH1(V),CH2(V),t0 =-6.000e-03, tInc = 1.0e-05,\n" + "".join(
    f",{value:.6e},{2 * value:.6e},,,\n" for value in VALUES
)
SETTINGS = [("Record Length", "2.5e+03"), ("Sample Interval", "1.0e-05"), ("Vertical Units", "mV")]
SETTINGS += [("Source", "CH1")]


def tektronix():
    lines = []
    for k, value in enumerate(VALUES):
        name, setting = SETTINGS[k] if k < len(SETTINGS) else ("", "")
        lines.append(f"{name},{setting},,{-6e-3 + k * 1e-5:.8f},{1e3 * value:.6f},\n")
    return "".join(lines)


@pytest.mark.parametrize("text", [RIGOL, RIGOL_4, tektronix()], ids=["rigol", "header", "tds"])
def test_time_and_values_of_an_oscilloscope(tmp_path, text):
    record = read_record(write(tmp_path, text), {"CH1": "V"})
    np.testing.assert_allclose(record.time, -6e-3 + 1e-5 * np.arange(COUNT), atol=1e-12)
    np.testing.assert_allclose(record.signals["CH1"], VALUES, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [("1.0e-05", "0", "increment of time is 0 s"), ("-6.0e-03", "", "t0 of the time is missing")],
)
def test_a_clock_that_is_none_is_refused(tmp_path, old, new, says):
    assert says in refusal(write(tmp_path, RIGOL.replace(old, new)))
