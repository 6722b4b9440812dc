"""Claims: a unit in the cells becomes that of the column, others of the quantity are converted,
and what is in none or of another quantity is refused.
"""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records.formats.cell_units import strip_units
from orchestration.records.tables import Column, Table, numbers


def stripped(*cells):
    table = Table("r.csv", [Column("I", None, list(cells))], np.arange(2, 2 + len(cells)))
    strip_units(table)
    return table.columns[0].unit, numbers(table, table.columns[0]).tolist()


@pytest.mark.parametrize(
    ("cells", "unit", "values"),
    [
        (["1 mA", "2.5mA", "-3e-1 mA"], "mA", [1.0, 2.5, -0.3]),
        (["500 mA", "1.5 A"], "mA", [500.0, 1500.0]),
        (["1", "2"], None, [1.0, 2.0]),
        (["20 °C", "25 °C"], "°C", [20.0, 25.0]),
    ],
)
def test_units_of_cells(cells, unit, values):
    assert stripped(*cells) == (unit, values)


def test_missing_cells_stay():
    assert np.isnan(stripped("1 mA", "", "OL")[1][1:]).all()


@pytest.mark.parametrize("cell", ["5", "5 V", "off"])
def test_another_quantity_or_none_is_refused(cell):
    with pytest.raises(UserError, match="row 3, column 'I'"):
        stripped("1 mA", cell)
