"""Claims: the picture of a system names everything that is in it."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from fmus.kit.errors import UserError
from orchestration.system import Connection, Port, library
from orchestration.system.drawing import draw


@pytest.mark.parametrize("name", library.NAMES)
def test_a_picture_names_everything(name, tmp_path, monkeypatch):
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParams, "svg.fonttype", "none")  # letters remain letters
    system = library.system(name)
    draw(system, tmp_path / "system.svg")
    text = (tmp_path / "system.svg").read_text(encoding="utf-8")
    words = re.findall(r"<text[^>]*>([^<]*)</text>", text)
    assert system.name in words
    for member in system.members:
        assert f"{member.name}: {member.fmu.stem}" in words
    ends = {(c.source, True) for c in system.connections} | {
        (c.target, False) for c in system.connections
    }
    ends |= {(port, False) for ports in system.inputs.values() for port in ports}
    ends |= {(port, True) for port in system.outputs.values()}
    wanted = (
        [port.variable for port, _ in ends]
        + [n for n, ps in system.inputs.items() for _ in ps]
        + [*system.outputs]
    )
    for word in set(wanted):
        assert words.count(word) == wanted.count(word), word


def test_a_factor_is_in_the_picture(tmp_path, monkeypatch):
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParams, "svg.fonttype", "none")
    system = library.system("dma_bench")
    wire = Connection(Port("bench", "position"), Port("actuator", "length_change"), 2.5, -0.001)
    draw(replace(system, connections=(wire, system.connections[1])), tmp_path / "system.svg")
    assert "× 2.5 -0.001" in (tmp_path / "system.svg").read_text(encoding="utf-8")


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"system\.bmp.*\.png, \.svg, \.pdf"):
        draw(library.system("dma_bench"), tmp_path / "system.bmp")
