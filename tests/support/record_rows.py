"""A record of two channels, written row by row, and what reading it says."""

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import read_record

SIGNALS = {"u": "V", "y": "m"}


def write_rows(folder, rows, header="time [s],u [V],y [m]", end="\n"):
    path = folder / "record.csv"
    path.write_text(
        "\n".join([header, *(",".join(str(cell) for cell in row) for row in rows)]) + end,
        encoding="utf-8",
    )
    return path


def varied_rows(count):
    """Rows whose channels are neither constant, quantised nor clipped."""
    rng = np.random.default_rng(1)
    return [[k, float(u), float(y)] for k, (u, y) in enumerate(rng.normal(size=(count, 2)))]


def read(path, **options):
    record = read_record(path, SIGNALS, inputs=["u"], **options)
    return record, {repair.kind: repair for repair in record.repairs}


def refusal(path, **options):
    with pytest.raises(UserError) as caught:
        read(path, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)
