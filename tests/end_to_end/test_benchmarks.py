"""The benchmarks work: every topic in its tiny form. How fast anything is, no test says."""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks import models, reading, stepping, sweeping, systems
from benchmarks.tables import Table, machine
from benchmarks.timing import Times, comparison, exponent, take_turns, timed, verdict


def finite(table: Table) -> None:
    """Every row is complete, and every number in it is finite and positive."""
    for row in table.rows:
        assert len(row) == len(table.columns)
        assert all(math.isfinite(cell) for cell in row if not isinstance(cell, str))


@pytest.mark.slow
@pytest.mark.parametrize("name", command.TOPICS)
def test_a_topic_is_measured(name: str) -> None:
    topic = command.TOPICS[name].measure(quick=True)
    assert topic.tables
    for table in topic.tables:
        finite(table)
        assert table.rows
        if "held against" in table.columns:
            names = [row[0] for row in table.rows]
            assert len(set(names)) == len(names)
            for name_of, best, against, of_best, median, _ in table.rows:
                assert best > 0.0
                assert against in names
                assert (of_best, median) == (1.0, 1.0) or against != name_of


def test_the_kernel_is_not_timed_where_its_outputs_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = stepping.bare_loop
    monkeypatch.setattr(stepping, "bare_loop", lambda *arguments: lambda: 2.0 * plain(*arguments)())
    with pytest.raises(RuntimeError, match="the kernel and the loops differ"):
        command.TOPICS["kernel"].measure(quick=True)


def test_sweeps_are_not_timed_where_their_numbers_differ() -> None:
    same = {sweeping.EACH: np.ones((2, 3)), "ppy sweep, FMU": np.ones((2, 3)) + 1e-12}
    sweeping.check_agreement(same)
    with pytest.raises(RuntimeError, match="compiled: not the numbers"):
        sweeping.check_agreement(same | {"ppy sweep, compiled": np.ones((2, 3)) + 1e-6})


def test_records_are_not_timed_where_their_signals_differ() -> None:
    exact = {"voltage": np.array([1.0, 2.0])}
    models.check_agreement({models.MACHINE: exact, models.PLAIN: exact})
    wrong = {"voltage": np.array([1.0, 2.0 + 1e-6])}
    with pytest.raises(RuntimeError, match="compiled model: voltage differs by 5e-07"):
        models.check_agreement({models.MACHINE: exact, models.PLAIN: wrong})


def test_masters_are_not_timed_where_their_positions_differ() -> None:
    systems.check_agreement({systems.OURS: 1.0, systems.ECOS: 1.0 + 1e-12})
    with pytest.raises(RuntimeError, match=r"Ecos: position 1\.001 after the last step, ours 1\.0"):
        systems.check_agreement({systems.OURS: 1.0, systems.ECOS: 1.001})


def test_tables_are_not_timed_where_their_numbers_differ() -> None:
    column = np.array([1.0, 2.0])
    reading.check_agreement({"ours": [column], "pandas": [column]})
    with pytest.raises(RuntimeError, match="ours and pandas: not the same numbers"):
        reading.check_agreement({"ours": [column], "pandas": [column + 1e-15]})


@pytest.mark.slow
def test_the_size_of_the_product_is_the_sum_of_its_rooms() -> None:
    (table,) = command.TOPICS["size"].measure().tables
    *rooms, whole = table.rows
    assert {"orchestration/records", "fmus/kit"} <= {room for room, *_ in rooms}
    assert whole == ["all", sum(nodes for _, nodes, _ in rooms), sum(n for *_, n in rooms)]


def test_take_turns_rotates_and_warms_up() -> None:
    called: list[str] = []
    times = take_turns({name: timed(partial(called.append, name)) for name in "abc"}, 2)
    assert "".join(called) == "abc" + "abc" + "bca"
    assert {len(seconds) for seconds in times.seconds.values()} == {2}


def test_ratios() -> None:
    times = Times({"a": np.array([2.0, 8.0, 3.0]), "b": np.array([1.0, 2.0, 3.0])})
    assert times.best("a") == 2.0
    assert times.ratio_of_best("a", "b") == 2.0
    assert times.median_ratio("a", "b") == 2.0  # of 2, 4 and 1
    table = comparison(times, {"a": "b"}, "ms", {"a": 1.5})
    assert table.rows == [
        ["a", 2000.0, "b", 2.0, 2.0, "1.5, missed"],
        ["b", 1000.0, "b", 1.0, 1.0, ""],
    ]
    assert verdict(1.5, 1.5) == "1.5, met"


def test_a_duration_is_divided_by_its_count() -> None:
    instants = iter([3.0, 7.0])
    assert timed(lambda: None, 8, lambda: next(instants))() == 0.5


def test_exponent_of_a_power_law() -> None:
    sizes = {"short": 10, "long": 100, "longest": 1000}
    times = Times({name: np.array([3.0 * n**1.25]) for name, n in sizes.items()})
    assert exponent(times, sizes) == pytest.approx(1.25)


def test_table_is_aligned_markdown() -> None:
    table = Table(["name", "count", "time"], [["a", 12345, 0.123456], ["long name", 1, 12345.6]])
    assert str(table).split("\n") == [
        "| name      |  count |   time |",
        "| --------- | -----: | -----: |",
        "| a         | 12,345 |  0.123 |",
        "| long name |      1 | 12,346 |",
    ]


def test_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "PAGE", tmp_path / "default.md")
    parts = ["Text.", Table(["x"], [[1.0]])]
    topic = command.Benchmark("Anything", "Work.", "a yardstick", lambda quick: iter(parts))
    monkeypatch.setattr(command, "TOPICS", {"any": topic})
    page = tmp_path / "page.md"
    command.main(["any", "--out", str(page)])
    assert page.read_text().startswith("# Benchmarks\n")
    assert str(machine()) in page.read_text()
    section = (
        "## Anything\n\nWork. Held against a yardstick.\n\nText.\n\n|   x |\n| --: |\n|   1 |\n"
    )
    assert page.read_text().endswith(section)
    assert "## Anything" in capsys.readouterr().out
    command.main(["--quick"])
    assert not (tmp_path / "default.md").exists()
    command.main([])
    assert (tmp_path / "default.md").read_text() == page.read_text()


def test_unknown_topic(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        command.main(["speed"])
    assert (
        f"unknown topic 'speed'; there are: {', '.join(command.TOPICS)}" in capsys.readouterr().err
    )
