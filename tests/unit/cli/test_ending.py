"""Claims: Ctrl-C while the command line is still imported ends the command as later, and a compiled
module that is cut off is told.
"""

from __future__ import annotations

import marshal
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from orchestration.cli.ending import kept_in
from orchestration.journal import WorkJournal

HEADER = 16  # bytes of a compiled module before its code (PEP 552)
PRESSED = """
import sys

class Pressed:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            raise {error}

sys.meta_path.insert(0, Pressed())
from orchestration.cli.__main__ import main
main()
"""


@pytest.mark.parametrize("name", ["typer", "fmus.kit", "orchestration.cli.commands.list"])
def test_an_interrupt_while_a_module_is_imported(name):
    code = PRESSED.format(name=name, error="KeyboardInterrupt")
    done = subprocess.run([sys.executable, "-c", code, "list"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_the_last_line_says_what_is_kept(tmp_path, capsys):
    journal = WorkJournal(tmp_path, "search", {}, (2000, 1))
    journal.keep(slice(1500), np.zeros((1500, 1)))
    for folder, told in (
        (tmp_path, f"1,500 of 2,000 points are kept in {tmp_path}, and the same command goes on"),
        (tmp_path / "gone", "none of the points was done"),
        (None, "nothing is kept; with --out FILE the same command would go on"),
    ):
        before = signal.getsignal(signal.SIGINT)
        with pytest.raises(SystemExit) as ended, kept_in(folder, "--out", "points"):
            raise KeyboardInterrupt
        signal.signal(signal.SIGINT, before)
        assert ended.value.code == 130
        assert capsys.readouterr().err.startswith(f"interrupted: {told}")


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A command, its environment with compiled modules of its own, and what it answers."""
    folder = tmp_path_factory.mktemp("compiled")
    command = [sys.executable, "-m", "orchestration.cli", "list"]
    environment = os.environ | {"PYTHONPYCACHEPREFIX": str(folder), "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return folder, command, environment, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("size", [HEADER + 1, 500, 1500])
@pytest.mark.parametrize("name", ["cli/app", "cli/commands/list"])
def test_a_compiled_module_that_was_cut_off(name, size, compiled):
    """As a full disk leaves it; Python takes it for whole, and typer its error for an interrupt."""
    folder, command, environment, answer = compiled
    (module,) = folder.rglob(f"orchestration/{name}.*.pyc")
    part = module.read_bytes()[:size]
    module.write_bytes(part)
    cut = subprocess.run(command, env=environment, capture_output=True, text=True)
    with pytest.raises(EOFError) as unreadable:
        marshal.loads(part[HEADER:])
    line = f"error: a compiled module is cut off ({unreadable.value}); remove {folder}\n"
    assert (cut.returncode, cut.stdout, cut.stderr.lstrip()) == (2, "", line)
    module.unlink()
    again = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (again.returncode, again.stdout) == (0, answer)


def test_an_end_of_file_of_something_else_is_no_interrupt_and_no_module():
    code = PRESSED.format(name="orchestration.cli.commands.list", error="EOFError('no data')")
    done = subprocess.run([sys.executable, "-c", code, "list"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.lstrip().startswith(
        "error: internal error, please report: EOFError: no data"
    )
