"""One record of four samples, for every form of file that it can have."""

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import read_record

SIGNALS = {"current": "A", "displacement": "m"}
TIME = np.array([0.0, 0.5, 1.0, 1.5])
CURRENT = np.array([0.1, -0.2, 0.3, 0.4])
DISPLACEMENT = np.array([1e-3, 2e-3, 4e-3, 3e-3])
PLAIN = (
    "time [s],current [A],displacement [m]\n0,0.1,1e-3\n0.5,-0.2,2e-3\n1,0.3,4e-3\n1.5,0.4,3e-3\n"
)


def write(folder, text, name="record.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def check(record):
    np.testing.assert_allclose(record.time, TIME, rtol=1e-15)
    np.testing.assert_allclose(record.signals["current"], CURRENT, rtol=1e-14)
    np.testing.assert_allclose(record.signals["displacement"], DISPLACEMENT, rtol=1e-14)
    assert record.units == SIGNALS


def refusal(path, signals=SIGNALS, **options):
    with pytest.raises(UserError) as caught:
        read_record(path, signals, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message
