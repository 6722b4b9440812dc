"""Claims: every module that a target of the Makefile runs is run by one that shows an error meant
for a user as a line; workers that it starts find its functions.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

MAKEFILE = Path(__file__).parents[2] / "Makefile"
MODULE = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from fmus.kit import UserError

def doubled(x):
    return 2 * x

if __name__ == "__main__":
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        print(sys.argv[1:], pool.submit(doubled, 21).result(), flush=True)
    raise UserError("rig.toml: rate is 0, and must be above 0")
"""


def test_an_error_for_a_user_is_a_line(tmp_path, monkeypatch):
    (tmp_path / "told.py").write_text(MODULE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    command = [sys.executable, "-m", "tests.support.target", "told", "--out", "here"]
    run = subprocess.run(command, cwd=MAKEFILE.parent, capture_output=True, text=True)
    assert run.stdout == "['--out', 'here'] 42\n"
    assert run.stderr == "error: rig.toml: rate is 0, and must be above 0\n"
    assert run.returncode == 1


def test_no_target_runs_a_module_of_ours_otherwise():
    modules = re.findall(
        r"python -m (\S+)", MAKEFILE.read_text().replace("-m tests.support.target", "")
    )
    assert [name for name in modules if name.startswith(("studies", "tests", "benchmarks"))] == []
