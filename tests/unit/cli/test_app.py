"""Claims: every command has help, and a simple question is answered quickly."""

import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from demonstrations.emulator.emulator import EmulatedRig
from orchestration.cli import app, commands
from tests.support.command import here, measure, ppy, refused, works
from tests.support.commands import COMMANDS as EVERY

COMMANDS = (
    "list",
    "info",
    "build",
    "check",
    "simulate",
    "run",
    "characterise",
    "compare",
    "diagnose",
    "frequency",
    "demo",
    "thesis",
)


@pytest.mark.parametrize("command", [(), *((c,) for c in COMMANDS)], ids=" ".join)
def test_help_of(command, tmp_path):
    text = works(*command, "--help", cwd=tmp_path)
    assert "Usage: " in text
    for expected in COMMANDS if not command else ("--help",):
        assert expected in text
    assert " [] " not in text, "brackets were taken for markup"


def test_the_help_of_all_commands_fits_a_terminal_and_says_first_what_is_wrong(tmp_path):
    done = ppy("--help", cwd=tmp_path, environment={"COLUMNS": "80"})
    lines = done.stdout.splitlines()
    assert len(lines) <= 27
    assert max(map(len, lines)) <= 80
    titles = [line for line in lines[1:] if not line.startswith(" ")]
    assert titles == ["Find out what is wrong", "Models, systems, experiments, rigs"]
    assert lines[2].split()[0] == "diagnose"


def test_every_command_is_listed_and_every_listed_one_exists(tmp_path):
    lines = works("--help", cwd=tmp_path).splitlines()
    shown = [line.split()[0] for line in lines if line.startswith("  ")]
    assert sorted(shown) == sorted({name.split()[0] for name in EVERY})
    for name in shown:
        assert "Usage: " in works(name, "--help", cwd=tmp_path)
    modules = {module.name for module in pkgutil.iter_modules(commands.__path__)}
    parts = {"options", "rig_record"}  # of other modules
    assert {f".{name}" for name in modules - parts} == {
        source.partition(":")[0] for _, source in app._OWN.values()
    }


def test_without_a_command_there_is_help(tmp_path):
    assert "Usage: " in works(cwd=tmp_path)


def test_the_installed_script_is_this_command_line(tmp_path):
    script = Path(sys.executable).with_name("ppy.exe" if os.name == "nt" else "ppy")
    if not script.exists():
        pytest.skip("the project is not installed in this environment")
    done = subprocess.run([script, "list"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, works("list", cwd=tmp_path))


@pytest.mark.parametrize(
    "arguments", [["--help"], ["list"], ["simulate", "--help"], ["run", "--list"]], ids=" ".join
)
def test_a_simple_question_imports_nothing_heavy(arguments, tmp_path):
    command = [sys.executable, "-X", "importtime", "-m", "orchestration.cli", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0
    imported = {
        line.rsplit("|", 1)[1].strip().split(".")[0]
        for line in done.stderr.splitlines()
        if "|" in line
    }
    assert "typer" in imported
    heavy = {
        "numpy",
        "scipy",
        "casadi",
        "pandas",
        "pint",
        "matplotlib",
        "fmpy",
        "statsmodels",
        "control",
        "xarray",
    }
    assert not imported & heavy


SIMULATE = ("simulate", "ppy_actuator", "--set", "current=0.5", "--set", "force=1")


@pytest.fixture
def record(tmp_path):
    return measure(tmp_path / "record.csv", EmulatedRig(seed=1), 300)


def test_version(tmp_path):
    from importlib.metadata import version

    assert works("--version", cwd=tmp_path) == f"ppy {version('ppy-rig')}\n"


def test_the_line_for_a_command_in_the_help_is_the_first_of_its_own_help():
    whole = typer.main.get_command(app.app)
    for name, (line, _) in app._commands().items():
        command = EVERY.get(name) or whole.get_command(None, name)
        assert command.help.split("\n")[0] == line


def test_every_command_that_sets_values_takes_a_file_of_them():
    typed = {
        name: {option for parameter in command.params for option in parameter.opts}
        for name, command in EVERY.items()
    }
    with_values = [name for name, options in typed.items() if "--set" in options]
    assert {"run", "simulate", "system cycles", "rig record"} <= set(with_values)
    assert [name for name in with_values if "--params" not in typed[name]] == []


OVEN = """
from orchestration.cli.command import command
from typing import TypedDict

COMMANDS = {
    "Find out what is wrong": {
        "heat": ("Heat the oven.", "oven:heat"),
        "list": ("Never in the place of ours.", "oven:heat"),
        "rig burn": ("Burn the rig.", "oven:heat"),
    }
}

@command(TypedDict("Nothing", {}))
def heat(options):
    print("hot")
"""


def installed_package(folder: Path, code: str) -> dict[str, str]:
    """Install a package with commands of its own there; return the environment that has it."""
    info = folder / "oven-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: oven\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[ppy_rig.commands]\noven = oven:COMMANDS\n")
    (folder / "oven.py").write_text(code)
    return {"PYTHONPATH": str(folder)}


def test_an_installed_package_brings_commands(tmp_path):
    has_oven = installed_package(tmp_path, OVEN)
    lines = ppy("--help", cwd=tmp_path, environment=has_oven).stdout.splitlines()
    shown = {line.split()[0]: line for line in lines if line.startswith("  ")}
    assert shown["heat"].endswith("  Heat the oven.")
    assert shown["list"].endswith("  List the components.")
    for command in (["heat"], ["rig", "burn"]):
        assert ppy(*command, cwd=tmp_path, environment=has_oven).stdout == "hot\n"


@pytest.mark.parametrize("code", ["import absent", "COMMANDS = None", "COMMANDS = {'a': {'b': 1}}"])
def test_a_package_whose_commands_cannot_be_loaded_is_a_line(code, tmp_path):
    done = ppy("--help", cwd=tmp_path, environment=installed_package(tmp_path, code))
    assert done.returncode == 0
    assert "  diagnose " in done.stdout
    (line,) = done.stderr.splitlines()
    assert "oven:COMMANDS" in line


def test_quiet_prints_results_and_errors_only(record, tmp_path):
    done = here("--quiet", "compare", record.name, "--out", "f.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "300 samples" in done.stdout
    assert "wrote" not in done.stdout
    assert (tmp_path / "f.json").exists()
    done = here("-q", "compare", "gone.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ")


def test_verbose_tells_what_is_used_and_how_long_it_took(tmp_path):
    lines = ppy("--verbose", *SIMULATE, "--stop", 1, cwd=tmp_path).stderr.splitlines()
    assert any(
        line.startswith("ppy_actuator: ") and line.endswith("ppy_actuator.fmu") for line in lines
    )
    assert any(line.startswith("simulating ppy_actuator: took ") for line in lines)


def test_one_cannot_have_both(tmp_path):
    refused(tmp_path, "-q", "-v", "list", parts=["--quiet and --verbose"])


def test_quiet_ends_with_the_command(tmp_path):
    here("--quiet", "list", cwd=tmp_path)
    assert "simulating" in here(*SIMULATE, "--stop", 1, cwd=tmp_path).stderr


WITHIN_A_CLASS = """
from orchestration.cli import app

class Pressed:
    def __set_name__(self, owner, name):
        raise KeyboardInterrupt

def run(**options):
    type("Made", (), {"attribute": Pressed()})

app.app = run
app.main()
"""


def test_ctrl_c_while_a_class_is_made_is_no_other_error(tmp_path):
    """Python 3.11 makes a RuntimeError of it."""
    done = subprocess.run(
        [sys.executable, "-c", WITHIN_A_CLASS], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
def test_a_full_standard_output_is_one_line(tmp_path):
    (tmp_path / "r.csv").write_text("time [s],I [A]\n0,1\n1,2\n")
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "orchestration.cli", "info", "r.csv"],
            cwd=tmp_path,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(app.__file__).parents[2])},
        )
    assert ended.returncode == 2
    assert ended.stderr == "error: standard output: No space left on device\n"
