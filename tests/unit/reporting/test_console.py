"""Claims: progress is told at once, then sparingly, with what is left to do; quiet and verbose mean
what they say.
"""

import contextlib
import io
import time

import pytest

from orchestration.reporting import console


@pytest.fixture
def told(monkeypatch):
    """Return a function for the lines on standard error, which is no terminal."""
    stream = io.StringIO()
    monkeypatch.setattr(console, "_INTERVAL", 0.2)
    monkeypatch.setattr(
        console, "err", console.Console(file=stream, highlight=False, markup=False, emoji=False)
    )
    return lambda: stream.getvalue().splitlines()


def test_every_step_is_a_line_of_its_own(told):
    with console.progress() as tell:
        for k in range(10):
            tell(f"step {k}")
    assert told() == [f"step {k}" for k in range(10)]


def test_the_first_step_can_be_named_at_once(told):
    with console.progress("building") as tell:
        tell("simulating")
    assert told() == ["building", "simulating"]


def test_a_short_step_tells_nothing_of_how_far_it_is(told):
    with console.progress() as tell:
        tell("simulating")
        for k in range(1000):
            tell.done(k, 1000)
    time.sleep(0.3)  # nothing comes after the end
    assert told() == ["simulating"]


def test_a_long_step_tells_now_and_then_how_far_it_is_and_what_is_left(told):
    with console.progress() as tell:
        tell("simulating")
        for k in range(28):
            tell.done(k, 28)
            time.sleep(0.025)
    first, *rest = told()
    assert first == "simulating"
    assert 2 <= len(rest) <= 4  # 0.7 s, one line in 0.2 s
    for line in rest:
        assert line.startswith("simulating (")
        assert " of 28" in line


def test_time_left_follows_from_the_pace(told, monkeypatch):
    clock = [1000.0]
    monkeypatch.setattr(console, "monotonic", lambda: clock[0])
    with console.progress() as tell:
        tell("fitting")
        tell.done(0, 28, "fitting leakage")
        clock[0] += 60.0
        tell.done(7, 28, "fitting diffusion")
    assert told()[2] == "fitting diffusion (7 of 28, 0:03:00 left)"


def test_what_is_built_before_the_first_part_is_no_part_of_the_pace(told, monkeypatch):
    """Seven of 1,501 points after 5 s of loading are no 18 minutes: 50 in 1 s have 29 s left."""
    clock = [1000.0]
    monkeypatch.setattr(console, "monotonic", lambda: clock[0])
    with console.progress() as tell:
        tell("running")
        clock[0] += 5.0
        tell.done(1, 1501, "point 1")
        clock[0] += 0.02
        tell.done(7, 1501, "point 7")
        clock[0] += 0.98
        tell.done(51, 1501, "point 51")
    assert told() == [
        "running",
        "point 1 (1 of 1,501)",
        "point 7 (7 of 1,501)",
        "point 51 (51 of 1,501, 0:00:29 left)",
    ]


def test_what_was_done_before_is_no_part_of_the_pace(told, monkeypatch):
    """A sweep that is taken up at 590 of 600 and does one case in 10 s has 90 s left with nine."""
    clock = [1000.0]
    monkeypatch.setattr(console, "monotonic", lambda: clock[0])
    with console.progress() as tell:
        tell("sweeping")
        tell.done(590, 600, "case 590")
        clock[0] += 10.0
        tell.done(591, 600, "case 591")
        tell("drawing")
        tell.done(0, 10, "figure 0")
        clock[0] += 10.0
        tell.done(5, 10, "figure 5")
    assert told() == [
        "sweeping",
        "case 590 (590 of 600)",
        "case 591 (591 of 600, 0:01:30 left)",
        "drawing",
        "figure 0 (0 of 10)",
        "figure 5 (5 of 10, 0:00:10 left)",
    ]


def test_parts_are_told_at_first_and_a_part_that_lasts_is_told_late(told):
    with console.progress() as tell:
        tell("looking at effects")
        for k in range(20):
            tell.done(k, 20, f"effect {k}")
        time.sleep(0.4)
    lines = told()
    assert lines[:2] == ["looking at effects", "effect 0 (0 of 20)"]
    assert [line.split(" (")[0] for line in lines[1:5]] == [f"effect {k}" for k in range(4)]
    assert [line.split(" (")[0] for line in lines[5:]] == ["effect 19"]


def test_an_error_ends_what_was_told(told):
    with contextlib.suppress(ValueError), console.progress() as tell:
        tell("simulating")
        tell.done(1, 2)
        raise ValueError
    time.sleep(0.3)
    assert told() == ["simulating"]


def test_quiet_says_nothing_and_ends(told, tmp_path):
    with console.verbosity(quiet=True), console.progress() as tell:
        tell("simulating")
        console.warn("something")
        console.note("something")
        console.tell_repairs(["something"])
    assert told() == []
    console.warn("again")
    assert told() == ["warning: again"]


def test_an_alarm_is_told_though_all_else_is_quiet(capsys):
    with console.verbosity(quiet=True):
        console.alarm("see to it")
        console.warn("never mind")
    assert capsys.readouterr().err == "ALARM: see to it\n"


def test_verbose_tells_times_and_details(told):
    console.detail("not wanted")
    with console.verbosity(verbose=True), console.progress() as tell:
        console.detail("wanted")
        tell("simulating")
        tell("fitting")
    assert [line.split(": took ")[0] for line in told()] == [
        "wanted",
        "simulating",
        "simulating",
        "fitting",
        "fitting",
    ]
    assert all(line.endswith(" s") for line in told() if "took" in line)


def test_what_was_written_is_no_result(capsys, tmp_path):
    console.wrote(tmp_path / "a.csv", "incomplete")
    with console.verbosity(quiet=True):
        console.wrote(tmp_path / "b.csv")
    with console.results_withheld():
        console.wrote(tmp_path / "c.csv")
    assert capsys.readouterr().out == f"wrote {tmp_path / 'a.csv'} (incomplete)\n"


def test_columns_of_numbers_end_together():
    stream = io.StringIO()
    table = console.plain_table(None, "name", "value", right=("value",))
    table.add_row("a", "1")
    table.add_row("b", "100")
    console.Console(file=stream, width=40).print(table)
    assert [line.rstrip() for line in stream.getvalue().splitlines()] == [
        "name  value",
        "a         1",
        "b       100",
    ]


def test_a_table_is_a_text_too(monkeypatch):
    """Without the codes of a terminal, without what stands behind the last letter of a line, though
    colours are asked for of whatever prints.
    """
    monkeypatch.setenv("FORCE_COLOR", "1")
    rows = [("[bold]x[/]", "1"), ("y", "22")]
    table = console.plain_table("of both", "name", "value", right=["value"], rows=rows)
    text = console.plain_text(table)
    assert text.splitlines() == [
        "of both",
        "name        value",
        "[bold]x[/]      1",
        "y              22",
    ]


def test_a_bar_is_where_somebody_looks(monkeypatch):
    for is_terminal in (False, True):
        stream = io.StringIO()
        screen = console.Console(file=stream, force_terminal=is_terminal, width=80)
        monkeypatch.setattr(console, "err", screen)
        with console.bar("sweep") as tell:
            if tell is not None:
                tell.done(7, 28)
                time.sleep(0.3)
        assert ("sweep" in stream.getvalue(), "7 of 28" in stream.getvalue()) == (is_terminal,) * 2
        assert (tell is not None) is is_terminal
