"""Pages of studies tell of the code as it is: they carry the digest of what drew them."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.judging import bench, foreign, hidden, laws, misuse, stamp

DRAWN = [
    (hidden, "make hidden-study"),
    (bench, "make bench-study"),
    (misuse, "make misuse-study"),
    (laws, "make laws-study"),
    (foreign, "make foreign-study"),
]


@pytest.mark.parametrize(
    ("page", "code", "how"),
    [(one.STUDY.path, one.STUDY.code, how) for one, how in DRAWN],
)
def test_a_page_was_drawn_with_this_code_or_says_that_it_was_not(page, code, how):
    text = page.read_text(encoding="utf-8")
    said = stamp.stamped(text)
    assert said, f"{page.name} has no stamp"
    if said != stamp.digest(code):
        assert stamp.is_outdated(text), (
            f"{page.name} is of other code: {how} draws it anew; until then OUTDATED of"
            " studies/judging/stamp.py stands under its stamp"
        )
    else:
        assert not stamp.is_outdated(text), f"{page.name} is of this code"


@pytest.mark.parametrize(
    ("change", "is_another"),
    [
        (
            lambda text: (
                text.replace('"""What it does."""', '"""What it is for."""') + "# a remark\n"
            ),
            False,
        ),
        (lambda text: text.replace("1.0", "1.5"), True),
        (lambda text: text.replace("def one", "def other"), True),
    ],
)
def test_a_digest_is_of_what_code_does(tmp_path: Path, monkeypatch, change, is_another):
    monkeypatch.setattr(stamp, "ROOT", tmp_path)
    module = tmp_path / "code" / "module.py"
    module.parent.mkdir()
    module.write_text('"""A module."""\n\n\ndef one():\n    """What it does."""\n    return 1.0\n')
    before = stamp.digest(["code"])
    module.write_text(change(module.read_text()))
    assert (stamp.digest(["code"]) != before) is is_another


@pytest.mark.parametrize(
    ("line", "is_part"),
    [
        ("from fmus.other import two", True),
        ("from fmus import other", True),
        ("import fmus.other", True),
        ("from .other import two", True),
        ("import json", False),
    ],
)
def test_a_digest_is_of_what_is_imported_too(tmp_path: Path, monkeypatch, line, is_part):
    monkeypatch.setattr(stamp, "ROOT", tmp_path)
    folder = tmp_path / "fmus"
    folder.mkdir()
    (folder / "one.py").write_text(f"def one():\n    {line}\n")
    (folder / "other.py").write_text("from .third import three\n\ntwo = three\n")
    (folder / "third.py").write_text("three = 3\n")
    before = stamp.digest(["fmus/one.py"])
    (folder / "third.py").write_text("three = 4\n")
    assert (stamp.digest(["fmus/one.py"]) != before) is is_part


def test_a_digest_is_not_of_what_hands_records_over(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(stamp, "ROOT", tmp_path)
    for folder, text in (("benchmarks", "from fmus.reading import read\n"), ("fmus", "read = 1\n")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "reading.py").write_text(text)
    assert stamp.sources(["benchmarks/reading.py"]) == {tmp_path / "benchmarks" / "reading.py"}


def test_a_diagnosis_is_made_of_what_decides_it():
    """Code called through a model or an option, and so by no import of the diagnosis, is named
    by itself.
    """
    deciding = (
        "fmus/kit/arms.py",
        "fmus/kit/curves.py",
        "fmus/kit/fmi/integrate.c",
        "fmus/kit/fmi/exponential.c",
        "orchestration/diagnosis/conclude.py",
        "orchestration/diagnosis/free_run.c",
        "orchestration/diagnosis/responses.c",
        "orchestration/diagnosis/search.py",
        "orchestration/records/quality/assessment.py",
    )
    sources = stamp.sources(hidden.STUDY.code)
    assert {stamp.ROOT / name for name in deciding} <= sources
    assert not any("report" in file.relative_to(stamp.ROOT).parts[1] for file in sources)
