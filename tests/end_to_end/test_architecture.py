"""Claims: the pictures of the layers are those of the imports, and a record goes the way that is
documented.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.hidden_electrical import DoubleLayer
from demonstrations.emulator.physics import RigParameters
from docs import draw_architecture as drawing
from orchestration.experiment.waveforms import steps
from orchestration.records import write_record
from tests.support.command import UNITS

PAGE = (drawing.ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
FILES = sorted(path.name for path in drawing.PICTURES.glob("layers*.svg"))
WAY = re.findall(r"^\d+\. `([\w/]+)`", PAGE, re.M)
# First call of a function in each module, whichever thread makes it; what an import does is no step
# of the way.
TRACE = """
import importlib, json, sys, threading
from pathlib import Path
modules, folder, command = json.loads(sys.argv[1])
for name in modules:
    importlib.import_module(name)
from orchestration.cli import app
entered = {}
def note(frame, event, argument):
    code = frame.f_code
    if event == "call" and code.co_filename.startswith(folder) and code.co_name != "<module>":
        entered.setdefault(code.co_filename)
sys.argv = command
threading.setprofile(note)
sys.setprofile(note)
try:
    app.main()
except SystemExit as end:
    assert not end.code, end.code
finally:
    sys.setprofile(None)
    threading.setprofile(None)
Path("trace.json").write_text(json.dumps(list(entered)))
"""


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES)
def test_a_picture_is_up_to_date(file: str) -> None:
    """`python docs/draw_architecture.py` brings it there."""
    assert (drawing.PICTURES / file).read_text(encoding="utf-8") == drawing.svg(
        drawing.plans()[file]
    )


def test_every_picture_is_there() -> None:
    assert sorted(drawing.plans()) == FILES


def test_every_room_is_described() -> None:
    rows = re.findall(r"^\| (`.*`) \|", PAGE, re.M)
    described = [name for row in rows for name in re.findall(r"`([\w/]+)`", row)]
    rooms = {
        path.parent
        for top in ("fmus", "orchestration")
        for path in (drawing.ROOT / top).glob("*/__init__.py")
    }
    rooms.add(drawing.ROOT / "ppy_rig")
    assert sorted(described) == sorted(path.relative_to(drawing.ROOT).as_posix() for path in rooms)


def ambiguous_record(path: Path) -> None:
    """Write a record that moves too seldom to tell a double layer from diffusion."""
    time = 0.2 * np.arange(1501)
    current = steps(time, [20.0, 70.0, 150.0, 200.0, 260.0], [0.3, -0.2, 0.4, 0.0, 0.3])
    force = np.full(time.size, 0.5)
    hidden = partial(DoubleLayer, transfer_resistance=0.1, layer_time=4.0)
    rig = EmulatedRig(RigParameters(), 1, NOISE["voltage"], NOISE["displacement"], hidden=hidden)
    write_record(
        path, time, {"current": current, "force": force} | rig.run(time, current, force), UNITS
    )


@pytest.mark.slow
def test_a_record_reaches_rooms_in_the_order_that_is_documented(tmp_path: Path) -> None:
    ambiguous_record(tmp_path / "record.csv")
    command = ["ppy", "diagnose", "record.csv", "--effects", "double_layer,diffusion"]
    command += ["--report", "report.html", "--experiment", "next.toml"]
    rooms = [drawing.ROOT / room for room in WAY]
    modules = [
        ".".join(path.relative_to(drawing.ROOT).with_suffix("").parts)
        for room in rooms
        for path in sorted(room.glob("*.py"))
        if not path.name.startswith("__")
    ]
    arguments = json.dumps([modules, str(drawing.ROOT / "orchestration"), command])
    done = subprocess.run(
        [sys.executable, "-c", TRACE, arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "next.toml").exists()
    entered = [Path(file).parent for file in json.loads((tmp_path / "trace.json").read_text())]
    assert list(dict.fromkeys(folder for folder in entered if folder in rooms)) == rooms
