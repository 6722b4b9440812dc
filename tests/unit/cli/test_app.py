"""Claims: every command has help, and a simple question is answered quickly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command import works

COMMANDS = (
    "list",
    "info",
    "build",
    "check",
    "simulate",
    "run",
    "compare",
    "diagnose",
    "laws",
    "demo",
    "thesis",
)


@pytest.mark.parametrize("command", [(), *((c,) for c in COMMANDS)], ids=" ".join)
def test_help_of(command, tmp_path):
    text = works(*command, "--help", cwd=tmp_path)
    assert "Usage: " in text
    for expected in COMMANDS if not command else ("--help",):
        assert expected in text


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
