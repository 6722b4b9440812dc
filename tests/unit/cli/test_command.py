"""Claims: a class of options becomes a command whose function gets their values."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest
import typer

from orchestration.api.declaration import options_of
from orchestration.cli.app import main
from orchestration.cli.command import command
from orchestration.cli.commands.options import BridgeCommand, RunCommand, SimulateCommand
from orchestration.cli.options import JsonOption
from orchestration.cli.outputs import write_json
from orchestration.reporting.console import out, wrote


def given(declared, *arguments):
    """Return what the function of a command gets for arguments."""
    received = []

    @command(declared)
    def body(options):
        """Do nothing."""
        received.append(options)

    one = typer.Typer()
    one.command()(body)
    typer.main.get_command(one)(arguments, standalone_mode=False)
    (options,) = received
    return options


def refused(declared, *arguments):
    """Return the message for arguments that are refused."""
    with pytest.raises(Exception) as error:  # its class moved between versions of typer
        given(declared, *arguments)
    return error.value.format_message()


def test_values_arrive_read():
    words = "m --set R1=1 --set C=2F --with a,b --stop 2min --map u=voltage --no-isolate"
    options = given(SimulateCommand, *words.split(), "--step-timeout", "1.5s")
    assert options["settings"] == {"R1": "1", "C": "2F"}
    assert options["laid_over"] == ["a", "b"]
    assert options["stop"] == 120.0
    assert options["mapping"] == {"u": "voltage"}
    assert options["isolate"] is False
    assert options["step_timeout"] == 1.5


def test_standard_output_is_for_json_alone_if_it_is_written_there(capsys, tmp_path):
    @command(JsonOption)
    def body(options):
        """Print, write and note a file, in this order."""
        out.print("a table")
        write_json(options["json"], {"a": 1})
        wrote(tmp_path / "page.html")

    one = typer.Typer()
    one.command()(body)
    made = typer.main.get_command(one)
    made(["--json", "-"], standalone_mode=False)
    assert json.loads(capsys.readouterr().out) == {"a": 1}
    made([], standalone_mode=False)
    assert capsys.readouterr().out == f"a table\nwrote {tmp_path / 'page.html'}\n"


def test_what_is_not_given_has_its_default():
    options = given(SimulateCommand, "m")
    usual = {name: option.default for name, option in options_of(SimulateCommand).items()}
    assert options == usual | {"model": "m"}
    assert given(RunCommand)["settings"] == ()


def test_what_must_be_given_is_asked_for():
    assert "Missing option '--endpoint'" in refused(BridgeCommand)


def test_a_value_that_makes_no_sense_is_refused_with_its_flag():
    message = refused(SimulateCommand, "m", "--stop", "soon")
    assert "'--stop': 'soon': 'soon' is not a number" in message
    message = refused(SimulateCommand, "m", "--memory-limit", "3MB")
    assert "'--memory-limit': '3MB': an amount of memory" in message


def test_a_second_argument_is_the_context():
    received = []

    @command(RunCommand)
    def body(options, context):
        """Do nothing."""
        received.append(context.get_parameter_source("lag").name)

    one = typer.Typer()
    one.command()(body)
    typer.main.get_command(one)(["--lag", "1s"], standalone_mode=False)
    assert received == ["COMMANDLINE"]


def asked(words):
    """Environment in which bash asks for what the last of some words may become."""
    place = str(len(words.split(" ")) - 1)
    return {"_PPY_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": place}


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("ppy sim", ["simulate"]),
        (
            "ppy info ppy_",
            ["ppy_actuator", "ppy_actuator_length_driven", "ppy_actuator_voltage_driven"],
        ),
        (
            "ppy build galvanostat foo",
            ["foot", "foot_design", "foot_displacement_driven", "foot_dynamic", "foot_free"],
        ),
        ("ppy compare x.csv --model galv", ["galvanostat"]),
        (
            "ppy simulate ppy_actuator --with strain_sat",
            ["strain_saturation", "strain_saturation(slow)"],
        ),
        ("ppy simulate ppy_actuator --with slack,sensor_lag(v", ["slack,sensor_lag(voltage)"]),
        ("ppy diagnose x.csv --effects diff", ["diffusion"]),
        ("ppy run fig_4", ["fig_4_4", "fig_4_5", "fig_4_8"]),
        ("ppy system show dma", ["dma_bench"]),
        (
            "ppy simulate galvanostat --with cur",
            ["current_saturation", "current_offset", "current_gain"],
        ),
        (
            "ppy compare x.csv --model galvanostat --with cur",
            ["current_saturation", "current_offset", "current_gain"],
        ),
        ("ppy simulate gone.fmu --with s", []),
    ],
)
def test_names_are_completed(words, offered, monkeypatch, capsys):
    for name, value in asked(words).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "argv", ["ppy"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert capsys.readouterr().out.split() == offered


def test_a_name_is_completed_in_a_process_of_its_own(tmp_path):
    command = [sys.executable, "-m", "orchestration.cli"]
    environment = os.environ | asked("ppy info voice")
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (done.stdout.split(), done.stderr) == (["voice_coil_dma"], "")


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_the_script_that_completes_is_shown():
    """The shell is the nearest above in the tree of processes, which must not be replaced."""
    command = f"'{sys.executable}' -m orchestration.cli --show-completion; true"
    assert "_PPY_COMPLETE" in subprocess.check_output(["bash", "-c", command], text=True)
