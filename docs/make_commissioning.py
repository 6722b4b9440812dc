"""Make the page with protocols of rigs that were commissioned, and its pictures.

``python docs/make_commissioning.py`` commissions the emulated rig and two devices of the tests
anew, each with real processes, and takes two minutes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer

import matplotlib
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(ROOT))

from orchestration.plugins.commission import (  # noqa: E402
    Line,
    Protocol,
    ServedRig,
    commission,
    read_device,
)
from tests.support.rig.process import BACKENDS  # noqa: E402
from tests.support.rig.wires import CALIBRATION, Instrument  # noqa: E402

_INTRODUCTION = """\
# Protections of three rigs, tried

Written by `python docs/make_commissioning.py`, which runs the procedure of `ppy rig commission`
([how](how-to/commission.md)) with real processes. The page that the command itself writes has these
lines, a larger picture for each, what was served with digests of its files, and lines to sign.

In the pictures each input is drawn as a share of the value that it was driven to: commanded (wide,
pale), applied (blue) and read back (green). A red line marks the fault, a dashed one the end of the
bound. A value is drawn from when it was heard on, up to 0.2 s later than it was applied while a
process is replaced: the times of the table are those of the answers.
"""
_SERIAL = """\
An instrument of the tests at the other end of a pseudo-terminal, by the backend `serial`: a current
whose safe value is 0.1 A.
"""
_DEVICE = """\
A device of the tests, which stands for hardware: it holds its last value, whichever process ends,
and has a heartbeat and a door. A script is the operator: it opens and closes the door, and says
that the relay dropped.
"""
_SERVED = ("--port", "0")
_BEFORE, _AFTER = 0.3, 0.7  # s that are drawn before a fault and after its bound
_WIDTH, _HEIGHT = 3.9, 0.78  # in, of the picture and of a row; 390 pixels of a phone
_STYLES = {
    "commanded": {"color": "#e0c48a", "linewidth": 4.0},
    "applied": {"color": "#0b6aa2", "linewidth": 2.0},
    "read_back": {"color": "#2e9e57", "linewidth": 1.0},
}


def emulated() -> Protocol:
    """Commission the emulated rig, beside which nobody stands."""
    device = read_device("emulator", {})
    return commission(ServedRig(device, _SERVED, 0.1, lambda question: None), told)


def serial(folder: Path) -> Protocol:
    """Commission an instrument on a serial port."""
    with Instrument() as instrument:
        calibration = folder / "rig.toml"
        # its setup would change an output when the port is opened
        calibration.write_text(
            CALIBRATION.format(port=instrument.port).replace('setup = ["CURR 0"]', "")
        )
        device = read_device("serial", {"calibration": str(calibration)})
        words = ["--backend", "serial", f"--option=calibration={calibration}", *_SERVED]
        words += ["--state", str(folder / "state")]
        return commission(ServedRig(device, words, 0.1, lambda question: None), told)


def held(folder: Path) -> Protocol:
    """Commission a device that holds its values, with an operator who does what is asked."""
    trigger = folder / "trigger"
    options = {"log": str(folder / "calls.log"), "trigger": str(trigger), "rate": "0.5"}
    device = read_device(f"{BACKENDS}:Beating", options)
    words = ["--backend", device.backend, *_SERVED, "--state", str(folder / "state")]
    words += [f"--option={name}={value}" for name, value in options.items()]

    def operate(question: str) -> bool:
        if "open door" in question:
            Timer(1.0, trigger.touch).start()
        if "close door" in question:
            trigger.unlink()
            time.sleep(0.5)  # a sample with the door closed
        return True

    return commission(ServedRig(device, words, 0.1, operate), told)


def told(line: Line) -> None:
    """Print a line of a protocol."""
    print(f"{line.verdict}: {line.title}: {line.finding.measured}", flush=True)


def draw(protocol: Protocol, path: Path) -> None:
    """Draw the checks of a protocol below each other."""
    drawn = [line for line in protocol.lines if len(line.rows) > 1]
    figure = Figure((_WIDTH, _HEIGHT * len(drawn)), layout="constrained")
    rows = figure.subplots(len(drawn), squeeze=False)[:, 0]
    for axes, line in zip(rows, drawn, strict=True):
        marks = [time for time, _ in line.finding.marks]
        origin = marks[0] if marks else line.rows[0].time
        times = np.array([row.time for row in line.rows]) - origin
        for name in protocol.units:
            target = max(abs(row.commanded[name]) for row in line.rows)
            for course, style in _STYLES.items():
                values = [getattr(row, course).get(name) for row in line.rows]
                shares = np.array(values, float) / target
                axes.step(times, shares, where="post", **style)
        for mark, style in zip(marks, ("-", "--"), strict=False):
            axes.axvline(mark - origin, color="#8f1f30", linewidth=0.9, linestyle=style)
        if marks:
            axes.set_xlim(-_BEFORE, marks[-1] - origin + _AFTER)
        axes.set_ylim(-0.1, 1.15)
        axes.set_title(line.title, fontsize=9, loc="left", pad=2)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    rows[-1].set_xlabel("time (s)", fontsize=9)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": path.name}):
        figure.savefig(path, metadata={"Date": None})


def section(title: str, text: str, protocol: Protocol, picture: str) -> Iterator[str]:
    """Yield the lines of a section."""
    yield f"\n## {title}\n"
    if text:
        yield text
    facts = protocol.facts
    yield (
        f"{facts['date'][:10]}, driven to {facts['driven to']}; period {facts['period']}, watchdog"
        f" {facts['watchdog']}, safe within {facts['safe within']}: {protocol.summary}.\n"
    )
    yield "| check | verdict | what was measured | what was done | what must hold |"
    yield "|---|---|---|---|---|"
    for line in protocol.lines:
        cells = (line.title, line.verdict, line.finding.measured, line.action, line.requirement)
        yield f"| {' | '.join(cells)} |"
    yield f"\n![Inputs of {title.lower()} over time in each check](pictures/{picture})"


def main() -> None:
    """Write the page and its pictures."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        protocols = {
            "The emulated rig": ("", emulated(), "commissioning_emulator.svg"),
            "An instrument on a serial port": (
                _SERIAL,
                serial(folder),
                "commissioning_serial.svg",
            ),
            "A device that holds its values": (_DEVICE, held(folder), "commissioning_device.svg"),
        }
    lines = [_INTRODUCTION.rstrip()]
    for title, (text, protocol, picture) in protocols.items():
        draw(protocol, DOCS / "pictures" / picture)
        lines += section(title, text, protocol, picture)
    (DOCS / "commissioning.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
