"""Claims: the search finds the structure that drew the data.

Its table is laid out like the thesis' table 3-2.
"""

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.identify.black_box import arx, box_jenkins, input_output_data, search_orders
from orchestration.identify.black_box.order_search import OrderSearch, Row
from tests.support.black_box import box_jenkins_record


def divided(seed=0, samples=3000):
    record = box_jenkins_record(seed, samples)
    return input_output_data(
        record.inputs, record.output, 0.1, ["force", "current"], "displacement"
    ).split(0.5)


@pytest.fixture(scope="module")
def search():
    return search_orders(*divided(), path_orders=(1, 2), noise_orders=(1, 2), nk=[1, 2])


@pytest.mark.slow
def test_the_smallest_model_that_holds_the_one_that_drew_the_data_is_chosen(search):
    """Its second path has two coefficients in the numerator, and so order two in this grid."""
    chosen = search.chosen
    assert (chosen.structure, chosen.path_orders, chosen.noise_order) == ("BJ", (2, 2), 1)
    assert chosen.validation_fit > max(row.validation_fit for row in search.best) - 0.5


@pytest.mark.slow
def test_all_combinations_are_there(search):
    counted = {
        s: sum(row.structure == s for row in search.rows)
        for s in ("ARX", "ARMAX", "OE", "SS", "BJ")
    }
    assert counted == {"ARX": 4, "ARMAX": 8, "OE": 4, "SS": 3, "BJ": 8}
    assert search.left_out == ()


@pytest.mark.slow
def test_rows_are_judged_by_the_same_samples(search):
    assert {len(row.identification.residual) for row in search.rows} == {1500 - 3}


@pytest.mark.slow
def test_figures_are_those_of_the_models(search):
    estimation, validation = divided()
    row = next(
        row
        for row in search.rows
        if (row.structure, row.path_orders, row.noise_order) == ("BJ", (2, 2), 1)
    )
    alone = box_jenkins(estimation, 2, 2, 1, 1, [1, 2])
    assert row.fit == pytest.approx(alone.fit, abs=0.05)
    assert row.validation_fit == pytest.approx(alone.model.fit(validation), abs=0.05)
    v = np.mean(row.identification.residual**2)
    assert row.aic == pytest.approx(np.log(v) + 2 * row.identification.count / 1497)
    assert row.bic == pytest.approx(np.log(v) + np.log(1497) * row.identification.count / 1497)


@pytest.mark.slow
def test_the_table_is_laid_out_like_table_3_2(search):
    lines = search.table().splitlines()
    head = (
        "Model type|% fit ID data|% fit validation data|AIC|BIC|force model order|current model"
        " order|Noise model order"
    )
    assert [cell.strip() for cell in lines[0].split("  ") if cell.strip()] == head.split("|")
    assert [line.split()[0] for line in lines[1:]] == ["ARX", "ARMAX", "OE", "SS", "BJ"]
    assert len({len(line) for line in lines}) == 1
    best = {row.structure: row for row in search.best}["BJ"]
    figures = [
        f"{best.fit:.1f}",
        f"{best.validation_fit:.1f}",
        f"{best.aic:.2f}",
        f"{best.bic:.2f}",
    ]
    assert lines[-1].split() == ["BJ", *figures, "2", "2", "1"]
    assert lines[4].split()[-1] == "constant"
    assert [line.split()[-1] for line in lines[1:4]] == ["2", "2", "0"]  # 1/A, C/A and 1
    assert len(search.table(search.rows).splitlines()) == len(search.rows) + 1


@pytest.mark.slow
def test_the_criterion_can_be_that_of_the_thesis():
    search = search_orders(
        *divided(), structures=["OE", "BJ"], path_orders=[2], noise_orders=[1, 2], criterion="AIC"
    )
    bj = [row for row in search.rows if row.structure == "BJ"]
    assert search.best[-1].aic == min(row.aic for row in bj)


@pytest.mark.slow
def test_free_runs_over_unseen_data_choose_among_structures(search):
    """The row is chosen by simulation even where another predicts one sample better."""
    by_criterion, other = search.best[0], search.best[2]
    rows = (
        replace(by_criterion, validation_fit=54.6, bic=-9.0),
        replace(other, validation_fit=92.1, bic=-7.0),
    )
    drawn = replace(search, rows=rows)
    assert [row.structure for row in drawn.ranked] == ["OE", "ARX"]
    assert drawn.chosen.structure == "OE"
    level = replace(search, rows=(rows[1], replace(rows[0], validation_fit=92.07)))
    assert level.chosen.structure == "ARX"


@pytest.fixture(scope="module")
def sound():
    return arx(divided()[0], 1, 1)


def searched(*rows):
    """Return a search with rows of structure, order, identification, fit and criterion."""
    return OrderSearch(
        tuple(Row(s, (n, n), 0, found, fit, fit, bic, bic) for s, n, found, fit, bic in rows),
        "BIC",
        (),
        (1, 1),
    )


def degenerate(sound):
    """Return a model one of whose parameters the data do not determine."""
    first, *others = sound.parameters
    return replace(sound, parameters=(replace(first, standard_error=np.inf), *others))


def integrating(sound):
    """Return a model with a pole at one."""
    return replace(sound, model=replace(sound.model, a=np.array([1.0, -1.0])))


@pytest.mark.parametrize("make", [degenerate, integrating])
def test_a_degenerate_model_is_passed_over_within_its_structure(sound, make):
    """The criterion prefers order 3, which follows unseen data no better than order 2 by 1 %."""
    found = searched(
        ("OE", 3, make(sound), 86.7, -6.0), ("OE", 2, sound, 86.2, -5.9), ("OE", 1, sound, 66, -5)
    )
    assert [row.path_orders for row in found.ranked] == [(2, 2)]
    assert [row.path_orders for row in found.passed_over] == [(3, 3)]


@pytest.mark.parametrize("make", [degenerate, integrating])
def test_a_degenerate_model_is_passed_over_among_structures(sound, make):
    found = searched(("OE", 3, make(sound), 86.7, -6.0), ("BJ", 2, sound, 85.8, -5.9))
    assert [row.structure for row in found.ranked] == ["BJ", "OE"]
    assert [row.structure for row in found.passed_over] == ["OE"]


@pytest.mark.parametrize("make", [degenerate, integrating])
def test_a_degenerate_model_stays_where_no_other_follows_as_well(sound, make):
    """A film that flows needs the pole at one."""
    found = searched(("OE", 3, make(sound), 86.7, -6.0), ("OE", 2, sound, 79.9, -5.9))
    assert found.chosen.path_orders == (3, 3)
    assert found.passed_over == ()


@pytest.mark.slow
def test_what_cannot_be_identified_is_left_out_and_told():
    estimation, validation = divided()
    sine = np.column_stack([np.sin(0.2 * np.arange(1500)), estimation.inputs[:, 1]])
    data = input_output_data(sine, estimation.output, 0.1, ["force", "current"], "displacement")
    search = search_orders(data, validation, ["OE"], [1, 2])
    assert {row.path_orders for row in search.rows} == {(1, 1), (1, 2)}
    assert [line.split(":")[0] for line in search.left_out] == [
        "OE of order 2 1",
        "OE of order 2 2",
    ]
    assert "input force is persistently exciting of order 2 only" in search.left_out[0]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"structures": ["BOX"]}, r"^structure BOX: there is none"),
        ({"criterion": "FPE"}, r"^criterion FPE: there is none \(there are: AIC, BIC\)$"),
        ({"path_orders": [0, 1]}, r"^path order = 0: must be a whole number, at least 1$"),
        ({"noise_orders": [1.5]}, r"^noise order = 1\.5: must be a whole number, at least 1$"),
        ({"path_orders": []}, r"at least one of each$"),
        (
            {"path_orders": [1, 10**9]},
            r"^path order 1000000000: 50 at most; of a longer polynomial",
        ),
        ({"noise_orders": [51]}, r"^noise order 51: 50 at most"),
        (
            {"path_orders": range(1, 51), "noise_orders": range(1, 6)},
            r"^12,500 combinations of orders for 2 inputs: 10,000 at most",
        ),
        (
            {"path_orders": [50], "nk": 1500},
            r"^no model can be identified; ARX of order 50 50: 1500 samples",
        ),
        (
            {"nk": -1},
            r"^delays\[0\] = -1: must be a whole number, at least 0$",
        ),
    ],
)
def test_mistakes_are_told_in_one_line(changed, said):
    with pytest.raises(UserError, match=said):
        search_orders(*divided(), **changed)
