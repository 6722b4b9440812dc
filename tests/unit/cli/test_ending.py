"""Claims: Ctrl-C while the command line is still imported ends the command as later."""

from __future__ import annotations

import subprocess
import sys

import pytest

PRESSED = """
import sys

class Pressed:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, Pressed())
from orchestration.cli.__main__ import main
main()
"""


@pytest.mark.parametrize("name", ["typer", "fmus.kit", "orchestration.cli.commands.list"])
def test_an_interrupt_while_a_module_is_imported(name):
    code = PRESSED.format(name=name)
    done = subprocess.run([sys.executable, "-c", code, "list"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")
