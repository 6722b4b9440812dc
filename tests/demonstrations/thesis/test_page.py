"""`ppy thesis` as a process: its table, its page in a real browser, and what it refuses."""

import re
from pathlib import Path

import numpy as np
import pytest

from demonstrations.thesis import chapters
from demonstrations.thesis.page import target
from fmus.kit.errors import UserError
from tests.support.browser import measured
from tests.support.command import ppy
from tests.support.pace import slow_but

SHOWN = [i for group in chapters.illustrations().values() for i in group if "4-" not in i.title]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Return the page and what was printed beside it, 100 columns wide."""
    folder = tmp_path_factory.mktemp("thesis")
    run = ppy("thesis", "--out", "made", cwd=folder)
    assert run.returncode == 0, run.stderr
    assert [p.name for p in folder.rglob("*.html")] == ["thesis.html"]
    return folder / "made" / "thesis.html", run


@pytest.fixture(scope="module")
def page(done):
    return done[0].read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_table_is_readable_in_100_columns(done):
    lines = done[1].stdout.splitlines()
    table = [line for line in lines if not re.match(r"wrote |\d+ printed figures", line)]
    assert max(map(len, table)) <= 100
    assert sum(line.split()[:2] == ["where", "quantity"] for line in lines) == len(
        chapters.CHAPTERS
    )
    for what in ("phase margin", "crossover frequency", "C_xx"):
        assert any(what in line for line in lines)
    (margin,) = (line for line in lines if "phase margin" in line)
    assert [word for word in ("107", "117.4 deg", "+9.7 %", "differs") if word not in margin] == []


@pytest.mark.slow
def test_the_time_left_is_that_of_all_figures_and_not_of_one(done):
    """They are parts of one step, so that the pace is that since the first of them."""
    steps = [line for line in done[1].stderr.splitlines() if " of " not in line.split(" (")[-1]]
    assert steps == ["recomputing tables and equations", "drawing the figures"]
    count = sum(map(len, chapters.illustrations().values()))
    assert f"(0 of {count})" in done[1].stderr


@pytest.mark.slow
def test_the_summary_counts_what_is_in_the_page(done, page):
    counts = re.search(
        r"(\d+) printed figures and statements: (\d+) hold, (\d+) are within.* (\d+) are reproduced"
        r" but "
        r"wrong, (\d+) differ\. (\d+) that follow from print: (\d+) hold, (\d+) differ\. "
        r"Each that does not hold has its reason; (\d+) errata",
        done[1].stdout,
    )
    assert counts is not None
    printed, *parts, inferred, inferred_hold, inferred_differ, errata = map(int, counts.groups())
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", line) for line in re.findall(r"<tr.*?</tr>", page)]
    claims = [row for row in cells if len(row) == 6]
    assert len([row for row in cells if len(row) == 4]) == errata
    starts = {
        kind: [row[5].split(";")[0] for row in claims if row[2].endswith(" (from print)") is kind]
        for kind in (False, True)
    }
    verdicts = ("holds", "within rounding", "only as printed", "differs")
    assert [starts[False].count(v) for v in verdicts] == parts
    assert [starts[True].count(v) for v in verdicts] == [inferred_hold, 0, 0, inferred_differ]
    assert [len(starts[kind]) for kind in (False, True)] == [printed, inferred]
    assert all(
        len(row[5].split(";")) > 1 for row in claims if row[5].startswith(("only", "differs"))
    )


@pytest.mark.slow
def test_the_page_needs_nothing_from_elsewhere(page):
    assert "http:" not in page
    assert "https:" not in page
    assert (
        page.count("data:image/png;base64,")
        == sum(map(len, chapters.illustrations().values()))
        >= 10
    )


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_shows_it(browser, page, width, tmp_path):
    (wide, view, pictures), complaints = measured(browser, tmp_path, page, width)
    assert complaints == []
    assert wide <= view
    assert pictures == page.count("<img ")


@pytest.mark.slow
def test_progress_is_told(done):
    assert any(line.startswith("Fig. 2-5") for line in done[1].stderr.splitlines())


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("page.pdf", "name a folder or a file that ends in .html"),
        ("plain", "name a folder or a file that ends in .html"),
        ("plain/thesis.html", "cannot write in "),
        ("plain/made", "cannot write in "),
        ("a" * 300 + ".html", "File name too long"),
    ],
)
def test_a_bad_place_is_refused(out, message, tmp_path, monkeypatch):
    (tmp_path / "plain").write_text("a file, no folder", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(message)) as refusal:
        target(Path(out))
    assert str(refusal.value).startswith(f"--out {out}: ")


@pytest.mark.parametrize(
    ("out", "file"),
    [
        ("made", "made/thesis.html"),
        ("a/b.html", "a/b.html"),
        (".", "thesis.html"),
        ("x.htm", "x.htm"),
    ],
)
def test_a_folder_or_a_file_may_be_named(out, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert target(Path(out)) == Path(file)


@pytest.mark.slow
def test_a_refusal_is_one_line_before_any_work(tmp_path):
    run = ppy("thesis", "--out", "page.pdf", cwd=tmp_path)
    assert run.returncode == 2
    assert run.stderr == "error: --out page.pdf: name a folder or a file that ends in .html\n"
    assert run.stdout == ""


@pytest.mark.parametrize(
    "illustration",
    slow_but(SHOWN, *(i for i in SHOWN if not i.title.startswith(("Section", "Fig. 5-8")))),
    ids=lambda i: i.title.split(":")[0],
)
def test_every_axis_has_a_name_and_a_unit(illustration):
    axes = illustration.draw().get_axes()
    across = axes[-1].get_xlabel()
    assert re.search(r"\[.+\]$", across) or across == "cycle", "a number has no unit"
    for axis in axes:
        assert re.search(r"\[.+\]$", axis.get_ylabel()) or axis.get_ylabel() == "forgetting factor"
        for line in axis.get_lines():
            assert np.isfinite(np.asarray(line.get_ydata(), dtype=float)).all()
    assert len(illustration.caption) > 80
