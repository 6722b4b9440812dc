"""Claims: channels with clocks of their own keep every sample at its instant, and have none at the
instants of others.
"""

import numpy as np

from orchestration.records.formats.clocks import on_one_clock
from orchestration.records.tables import Column


def test_every_sample_keeps_its_instant():
    times = [0.1 * np.arange(7), 0.3 + 0.2 * np.arange(4), np.array([0.25])]
    columns = [Column(f"c{k}", "V", np.arange(t.size) + 10.0 * k) for k, t in enumerate(times)]
    clock, *found = on_one_clock(columns, times)
    assert clock.unit == "s"
    assert np.all(np.diff(clock.cells) > 0.01)
    for column, own, original in zip(found, times, columns, strict=True):
        measured = np.isfinite(column.cells)
        np.testing.assert_allclose(clock.cells[measured], own, atol=1e-9)
        np.testing.assert_array_equal(column.cells[measured], original.cells)
