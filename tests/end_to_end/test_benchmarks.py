"""The benchmarks work: every topic in its tiny form. How fast anything is, no test says."""

import io
import math
import sys
import zipfile
from functools import partial
from pathlib import Path
from time import thread_time
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks import (
    ageing,
    building,
    coupling,
    diagnosing,
    diagnosing_split,
    importing,
    isolating,
    kernel,
    machine,
    mapping,
    master,
    pacing,
    record,
    sizing,
    stepping,
    sweeping,
    versions,
    wrapping,
)
from benchmarks.tables import Table, Topic
from benchmarks.timing import Times, pooled, take_turns


def rows(table: Table) -> dict[str, list[Any]]:
    """Rows by their first cell; every number in them is finite."""
    for row in table.rows:
        assert len(row) == len(table.columns)
        assert all(math.isfinite(cell) for cell in row if not isinstance(cell, str))
    return {str(row[0]): list(row[1:]) for row in table.rows}


def test_step() -> None:
    topic = stepping.measure(quick=True)
    assert len(topic.tables) == 4  # two hosts, two inputs
    for table in topic.tables:
        found = rows(table)
        assert list(found) == [
            stepping.EMPTY,
            stepping.YARDSTICK,
            stepping.NATIVE,
            stepping.PYTHON,
            stepping.STOCK,
        ]
        assert found[stepping.YARDSTICK][-3:] == found[stepping.STOCK][-3:] == [1.0, 1.0, "1 ... 1"]
        assert all(row[0] > 0.0 for row in found.values())
    for name, (other, _) in stepping.TARGETS.items():
        assert f"{name} " in str(topic)
        assert f" of {other} (target" in str(topic)


def test_versions() -> None:
    topic = versions.measure(quick=True)
    (table,) = topic.tables
    assert list(rows(table)) == list(versions.COMPONENTS)
    assert f"(target {versions.TARGET}, " in str(topic)


def test_record() -> None:
    against, growth = record.measure(quick=True).tables
    assert list(rows(against)) == [record.BARE, record.PLAIN, record.SENSITIVE, record.MACHINE]
    lengths = [int(n) for n in rows(growth)]
    assert lengths == sorted(lengths)
    assert all(spent > 0.0 for spent, _ in rows(growth).values())


def test_kernel() -> None:
    (table,) = kernel.measure(quick=True).tables
    found = rows(table)
    assert list(found) == [stepping.EMPTY, stepping.YARDSTICK, stepping.NATIVE]
    assert all(figure > 0.0 for row in found.values() for figure in row)


def test_kernel_refuses_to_time_different_results(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = kernel.bare_loop
    monkeypatch.setattr(kernel, "bare_loop", lambda *arguments: lambda: 2.0 * plain(*arguments)())
    with pytest.raises(RuntimeError, match="the kernel and the loops differ"):
        kernel.measure(quick=True)


@pytest.mark.slow
def test_isolation() -> None:
    topic = isolating.measure(quick=True)
    (table,) = topic.tables
    assert list(rows(table)) == [stepping.NATIVE, stepping.YARDSTICK]
    assert str(topic).count("more a step (target 10") == 2


@pytest.mark.slow
def test_fmi3() -> None:
    steps, arrays = wrapping.measure(quick=True).tables
    assert list(rows(steps)) == list(wrapping.NAMES)
    assert list(rows(arrays)) == ["1000", "10000"]


@pytest.mark.slow
def test_pacing() -> None:
    (table,) = pacing.measure(quick=True).tables
    found = rows(table)
    assert list(found) == [
        f"{rate} Hz, {name}" for rate in pacing.RATES for name in (pacing.MASTER, pacing.BARE)
    ]
    for name, figures in found.items():
        assert 0.0 <= figures[0] <= figures[1] <= figures[2]
        assert figures[3:] == [1.0, 1.0] or not name.endswith(pacing.BARE)


@pytest.mark.slow
def test_sweeps() -> None:
    topic = sweeping.measure(quick=True)
    ways, beside, memory = topic.tables
    assert list(rows(ways)) == [
        *(
            f"{stepping.NATIVE}: {way}"
            for way in (sweeping.EACH, sweeping.REUSE, sweeping.FMU, sweeping.COMPILED)
        ),
        *(f"{stepping.YARDSTICK}: {way}" for way in (sweeping.EACH, sweeping.REUSE, sweeping.FMU)),
    ]
    assert all(figure > 0.0 for row in [*ways.rows, *beside.rows] for figure in row[1:])
    assert rows(ways)[f"{stepping.NATIVE}: {sweeping.EACH}"][1] == 1.0
    assert len(rows(beside)) == 2
    assert all(mb > 10.0 for _, mb in memory.rows)
    assert str(topic).count("(target ") == len(sweeping.TARGETS) * 2 - 1 + 1, (
        "compiled is ours alone; two workers"
    )


def test_sweeps_refuse_to_time_different_results() -> None:
    same = {sweeping.EACH: np.ones((2, 3)), sweeping.FMU: np.ones((2, 3)) + 1e-12}
    sweeping.check_agreement(same)
    with pytest.raises(RuntimeError, match="compiled: not the numbers"):
        sweeping.check_agreement(same | {sweeping.COMPILED: np.ones((2, 3)) + 1e-6})


@pytest.mark.slow
def test_a_sweep_on_a_cluster_is_sized_by_its_slowest_share() -> None:
    found = sizing.sized(case=3.2e-3, head=2e-6, size=1250.0, part=64)
    assert {who: whole for who, (_, whole) in found.items()} == pytest.approx(
        {
            "the workers": 1.0,
            "the machine that asks": 2.0,
            "the scheduler": 15.625,
            "the network": 10.0,
        }
    )
    text = str(sizing.measure(cases=70, points=11))
    assert text.count("the bottleneck is the ") == 2


def test_record_refuses_to_time_different_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "AGREEMENT", -1.0)
    with pytest.raises(RuntimeError, match=r"bare loop in C: \w+ differs by"):
        record.measure(quick=True)


def test_ageing() -> None:
    (table,) = ageing.measure(quick=True).tables
    found = rows(table)
    assert list(found) == [ageing.LIFE, ageing.STEPS]
    assert found[ageing.LIFE][-1] == 1.0
    for best, speed, _, _ in found.values():
        assert speed * best == pytest.approx(20.0)


def test_coupling() -> None:
    (table,) = coupling.measure(quick=True).tables
    found = rows(table)
    assert list(found) == list(coupling.WAYS)
    for coarse, fine, order, *_ in found.values():
        assert order == pytest.approx(math.log2(coarse / fine), abs=0.006)


def test_master() -> None:
    alone, recorded, size, length = master.measure(quick=True).tables
    assert list(rows(alone)) == [master.OURS, master.CALLS, master.ECOS, master.COSIM]
    assert list(rows(recorded)) == [
        master.OURS,
        master.OURS_IN_TURN,
        master.ECOS,
        master.COSIM,
        master.FUSED,
    ]
    for table in (alone, recorded):
        assert rows(table)[master.OURS][-1] == 1.0
        assert all(best > 0.0 for best, _ in rows(table).values())
    for table in (size, length):
        counts = [int(n) for n in rows(table)]
        assert counts == sorted(counts)


def test_master_refuses_to_time_different_results() -> None:
    master.check_agreement({master.OURS: 1.0, master.ECOS: 1.0 + 1e-12})
    with pytest.raises(RuntimeError, match=r"Ecos: position 1\.001 after the last step, ours 1\.0"):
        master.check_agreement({master.OURS: 1.0, master.ECOS: 1.001})


def test_import() -> None:
    commands, *heaviest = importing.measure(quick=True).tables
    assert list(rows(commands)) == list(importing.COMMANDS)
    assert len(heaviest) == len(importing.COMMANDS) - 1
    for table in heaviest:
        *packages, everything = [spent for spent, _ in rows(table).values()]
        assert packages == sorted(packages, reverse=True)
        assert sum(packages) <= everything * (1 + 1e-9)


@pytest.mark.slow
def test_build() -> None:
    spent, size = building.measure(quick=True).tables
    assert next(iter(rows(spent))) == building.NOTHING
    for runtime, (binary, rest, total) in rows(size).items():
        compressed, library = (int(word.strip("()").replace(",", "")) for word in binary.split())
        assert runtime in ("python", "native")
        assert 0 < compressed < library
        assert compressed + rest < total  # what is left is the directory of the archive


@pytest.mark.slow
def test_a_diagnosis_is_timed_over_the_length_of_the_record():
    (table,) = diagnosing.measure(quick=True).tables
    assert [row[0] for row in table.rows] == [600, 1200]
    assert all(
        row[1] > 0.0 and row[2] == pytest.approx(1e6 * row[1] / row[0]) for row in table.rows
    )
    assert {row[4] for row in table.rows} == {"strain_saturation"}


def test_a_stopwatch_counts_a_function_less_what_it_calls_of_another_stage():
    watch = diagnosing_split.Stopwatch()
    module = ModuleType("stages")
    sys.modules["stages"] = module
    busy = SimpleNamespace(seconds=0.05)

    def inner():
        end = thread_time() + busy.seconds
        while thread_time() < end:
            pass

    def outer():
        inner_of_module = module.inner
        inner_of_module()
        end = thread_time() + busy.seconds
        while thread_time() < end:
            pass

    module.inner = inner
    module.outer = outer
    try:
        watch.attach("fit", "stages", "outer")
        watch.attach("judge", "stages", "inner")
        module.outer()
    finally:
        del sys.modules["stages"]
    assert watch.seconds["fit"] == pytest.approx(busy.seconds, rel=0.2)
    assert watch.seconds["judge"] == pytest.approx(busy.seconds, rel=0.2)


@pytest.mark.slow
def test_the_time_of_a_diagnosis_is_split():
    (table,) = diagnosing_split.measure(quick=True).tables
    assert [row[0] for row in table.rows] == ["median", "worst"]
    for row in table.rows:
        assert all(seconds >= 0.0 for seconds in row[1:-1])
        assert row[-1] <= sum(row[1:-1]) * 1.5 + 0.5
    assert table.rows[0][-1] <= table.rows[1][-1]


@pytest.mark.slow
def test_a_map_of_laws_is_timed_over_the_length_of_the_record():
    (table,) = mapping.measure(quick=True).tables
    assert [row[0] for row in table.rows] == [300, 600]
    for samples, entries, seconds, of_a_sample, peak, simulations, met in table.rows:
        assert entries >= 0
        assert seconds > 0.0
        assert of_a_sample == pytest.approx(1e6 * seconds / samples)
        assert 0.01 < peak < 10.0, "GB"
        assert simulations >= 0.0
        assert met == "", "the target is for ten minutes"


def test_a_platform_without_a_library_is_not_built() -> None:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("binaries/linux64/x.so", b"12345")
        file.writestr("modelDescription.xml", b"123")
    table = building.sizes({"native": archive.getvalue()}, ["linux64", "win64"])
    assert table.rows == [["native", "5 (5)", "not built", 3, len(archive.getvalue())]]


def test_import_times_are_added_up_by_package() -> None:
    report = "\n".join(
        [
            "import time: self [us] | cumulative | imported package",
            "import time:       100 |        100 |   a.b",
            "import time:      1500 |       1600 | a",
            "import time:        30 |         30 | c",
        ]
    )
    assert importing.own_times(report) == pytest.approx({"a": 1.6, "c": 0.03})


def test_take_turns_rotates_and_warms_up() -> None:
    called: list[str] = []
    times = take_turns({name: partial(called.append, name) for name in "abc"}, 2)
    assert "".join(called) == "abc" + "abc" + "bca"
    assert {len(seconds) for seconds in times.seconds.values()} == {2}


def test_ratios() -> None:
    times = Times({"a": np.array([2.0, 8.0, 3.0]), "b": np.array([1.0, 2.0, 3.0])})
    assert times.best("a") == 2.0
    assert times.median("a") == 3.0
    assert times.ratio_of_best("a", "b") == 2.0
    assert times.median_ratio("a", "b") == 2.0  # of 2, 4 and 1


def test_pooled_rounds_stay_paired() -> None:
    parts = [
        Times({"a": np.array([2.0]), "b": np.array([1.0])}),
        Times({"a": np.array([9.0, 8.0]), "b": np.ones(2)}),
    ]
    times = pooled(parts)
    assert times.best("a") == 2.0
    assert times.median_ratio("a", "b") == 8.0


def test_exponent_of_a_power_law() -> None:
    times = Times({str(n): np.array([3.0 * n**1.25]) for n in (10, 100, 1000)})
    assert record.exponent(times, (10, 100, 1000)) == pytest.approx(1.25)


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
    topic = Topic("Anything", ["Text.", Table(["x"], [[1.0]])])
    monkeypatch.setattr(command, "TOPICS", {"any": lambda quick: topic})
    page = tmp_path / "page.md"
    command.main(["any", "--out", str(page)])
    assert page.read_text().startswith("# Benchmarks\n")
    assert str(machine.describe()) in page.read_text()
    assert page.read_text().endswith("## Anything\n\nText.\n\n|   x |\n| --: |\n|   1 |\n")
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
