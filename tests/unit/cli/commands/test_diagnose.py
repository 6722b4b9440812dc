"""Claims: ``ppy laws`` tells its result, writes what was asked for, and overwrites nothing; what
``ppy diagnose`` makes is for this machine.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from fmus.kit.build.toolchain import available_platforms, host_platform
from orchestration.cli import diagnose as asking
from orchestration.cli.app import main
from tests.support.command import here
from tests.support.lacking import motor

MODEL = Path(__file__).parents[4] / "studies" / "plants" / "models" / "motor.py"

RECALIBRATE = ("diagnose", "--effects", "none", "--no-laws")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Record a motor that is just what its model says."""
    folder = tmp_path_factory.mktemp("laws")
    shutil.copy(MODEL, folder / "motor.py")
    motor(folder / "clean.csv", None)
    return folder


def refused(*arguments, cwd):
    """Return the message of a refusal, which is one line and exit code 2."""
    done = here("laws", *arguments, "--model", "motor.py:Motor", cwd=cwd)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    return done.stderr.strip().splitlines()[-1]


@pytest.mark.slow
def test_where_nothing_is_wrong_nothing_is_found(folder):
    outputs = [
        "--json",
        "laws.json",
        "--report",
        "laws.html",
        "--effect-out",
        "law.py",
        "--fmu",
        "f.fmu",
    ]
    done = here("laws", "clean.csv", "--model", "motor.py:Motor", *outputs, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(("consistent", "recalibrate"))
    assert "what each law lacks, to first order" in done.stdout
    written = json.loads((folder / "laws.json").read_text(encoding="utf-8"))
    assert written["causes"] == []
    assert {(row["law"], row["signal"]) for row in written["law_map"]} >= {("friction", "omega")}
    assert "--effect-out law.py" in (folder / "laws.html").read_text(encoding="utf-8")
    for name in ("law.py", "f.fmu"):
        assert f"no law is found to lack anything: {name} was not written" in done.stderr
        assert not (folder / name).exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--effect-out", "motor.py"], "--effect-out motor.py: this is the file of --model itself"),
        (
            ["--json", "clean.csv"],
            "--json clean.csv: this is the record itself; it will not be overwritten",
        ),
        (["--effect-out", "law.txt"], "--effect-out law.txt: its name must end in .py"),
        (["--report", "r.pdf"], "--report r.pdf: its name must end in .html"),
        (["--fmu", "f.zip"], "the name of an FMU ends in .fmu"),
        (["--effects", "coulomb"], "no effect named 'coulomb'"),
        (["--hold", "dampin"], "no parameter named 'dampin'"),
        (["--holdout", "clean.csv"], "this is the record itself; nothing would be held out"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(folder, arguments, told):
    line = refused("clean.csv", *arguments, cwd=folder)
    assert line.startswith("error: ")
    assert told in line


def test_what_was_asked_reaches_the_laws_and_all_is_written(folder, monkeypatch, capsys):
    """The answer itself is a stand-in; who gives a real one is tested by itself."""
    monkeypatch.chdir(folder)
    asked, typed, written, platforms = {}, {}, [], []

    def writes(path, *others):
        written.append(str(path))
        platforms.extend(others[:1] if path.suffix == ".fmu" else ())
        return [path] if path.suffix == ".fmu" else path

    def answer(records, model, **options):
        asked.update(options, model=model.cls.__name__, record=records[0].source.name)
        answered = SimpleNamespace(
            as_typed=lambda command, written: typed.update(written) or answered,
            overview=lambda: ["friction depends on omega"],
            to_dict=lambda: {"law_map": []},
            causes=["friction(omega)"],
            is_interrupted=False,
            report=writes,
            effect=writes,
            fmu=writes,
        )
        return answered

    monkeypatch.setattr(asking, "laws", answer)
    options = (
        "--effects coulomb_friction --hold resistance --set damping=1e-4 --time 20s"
        " --no-interpolate"
    )
    outputs = "--report a.html --effect-out a.py --fmu a.fmu --platforms all,linux64"
    monkeypatch.setattr(
        "sys.argv", ["ppy", *f"laws clean.csv --model motor.py:Motor {options} {outputs}".split()]
    )
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert (asked["model"], asked["record"]) == ("Motor", "clean.csv")
    assert (asked["effects"], asked["hold"]) == (["coulomb_friction"], ["resistance"])
    assert (asked["settings"], asked["time"], asked["interpolate"]) == (
        {"damping": "1e-4"},
        20.0,
        False,
    )
    assert written == ["a.html", "a.py", "a.fmu"]
    assert platforms == [available_platforms()]
    assert typed == {"fmu": "a.fmu"}
    assert "friction depends on omega" in capsys.readouterr().out


def test_json_of_diagnose(record, tmp_path):
    done = here(*RECALIBRATE, record.name, "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] in (
        "consistent",
        "recalibrate",
        "unexplained",
        "ambiguous",
    )


def platforms_of(path):
    from orchestration.fmu.archive import Archive

    with Archive(path) as archive:
        return archive.platforms


def test_diagnose_builds_for_this_machine(record, tmp_path):
    done = here(*RECALIBRATE, record.name, "--fmu", "f.fmu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (
        platforms_of(tmp_path / "f.fmu")
        == platforms_of(tmp_path / "f.python.fmu")
        == [host_platform()]
    )


@pytest.mark.parametrize(
    ("required", "code"), [("consistent", 1), ("consistent,recalibrate", 0), ("recalibrate", 0)]
)
def test_the_verdict_that_is_required_sets_the_exit_status(record, tmp_path, required, code):
    """The rig has another R1 and C than the model, and nothing else is wrong with it."""
    arguments = ("--effects", "none", "--no-laws", "--require", required)
    done = here("diagnose", record, *arguments, "--json", "d.json", cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert (tmp_path / "d.json").exists()
    assert ("--require consistent: the verdict is recalibrate" in done.stderr) == bool(code)


def test_a_verdict_that_nobody_knows_is_refused(record, tmp_path):
    done = here("diagnose", record, "--require", "fine", cwd=tmp_path)
    assert done.returncode == 2
    assert "--require fine: there are consistent, recalibrate" in done.stderr
