"""Claims: a notebook of the gallery runs as a reader runs it, and says what its text says; a tour
ends in an FMU that another tool runs as the record has it.

All of them run when the site is built (`test_site.py`); tours and one with a loop run here.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.site import ROOT

GALLERY = ROOT / "docs" / "gallery"
TOURS = ("battery", "motor", "another_tool", "actuator", "own_law")
NOISE = {"battery": (0.5, "mV"), "motor": (0.3, "rad/s"), "own_law": (2.0, "mm")}  # of the record
FOUND = {
    "battery": {"capacity": 2.45, "R0": 0.027, "R1": 0.013, "C1": 18.0 / 0.013}
    | {"R2": 0.016, "tau2": 240.0, "hysteresis_voltage": 0.012, "hysteresis_rate": 60.0}
    | {"activation": 2600.0, "heat_capacity": 42.0, "thermal_resistance": 7.0},
    "motor": {"resistance": 1.8, "constant": 0.047, "inertia": 4.3e-4, "damping": 1.6e-4}
    | {"friction_coulomb": 0.012, "heating": 0.06, "warming_time": 25.0},
    "another_tool": {"loss": 62.0, "capacity": 2.6e5, "temperature_of_temperature": -0.1},
    "own_law": {"share": 1.0, "conductance": 0.011, "area": 0.5},
}
NOTEBOOKS = sorted(path for path in GALLERY.glob("*.md") if path.stem != "index")


def executed(path: Path, folder: Path) -> list[dict]:
    """Outputs of a notebook that runs in a folder of its own."""
    nbclient = pytest.importorskip("nbclient", reason="no tools of the documentation")
    from myst_nb.core.read import read_myst_markdown_notebook
    from myst_parser.config.main import MdParserConfig

    notebook = read_myst_markdown_notebook(path.read_text(encoding="utf-8"), MdParserConfig())
    resources = {"metadata": {"path": str(folder)}}
    nbclient.NotebookClient(notebook, timeout=300, resources=resources).execute()
    return [output for cell in notebook.cells for output in cell.get("outputs", ())]


@pytest.mark.slow
def test_the_loop_of_the_bench_is_closed(tmp_path: Path) -> None:
    """The grip's law is linear, so that what is left of it is the error of the loop alone."""
    outputs = executed(GALLERY / "bench.md", tmp_path)
    printed = "".join(output.get("text", "") for output in outputs)
    assert "algebraic loop of actuator.length_change, actuator.tension, grip." in printed
    texts = [output["data"].get("text/plain", "") for output in outputs if "data" in output]
    (left,) = [float(text) for text in texts if re.fullmatch(r"[\d.]+e-\d+", text)]
    assert left < 1e-9
    assert sum("image/png" in output.get("data", ()) for output in outputs) == 1
    assert (tmp_path / "compliant_bench.ssp").exists()


def texts_of(name: str, folder: Path) -> list[str]:
    """Return the texts that a tour shows when it runs in a folder."""
    outputs = executed(GALLERY / f"{name}.md", folder)
    return [output["data"].get("text/plain", "") for output in outputs if "data" in output]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", FOUND)
def test_a_tour_shows_what_its_generator_has_hidden_and_hands_over_an_fmu(
    name: str, tmp_path: Path
) -> None:
    """In FMPy, the record's own noise is all that is left."""
    texts = texts_of(name, tmp_path)
    for parameter, true in FOUND[name].items():
        lines = (line for text in texts for line in text.splitlines())
        row = next(line for line in lines if line.startswith(f"{parameter} "))
        assert float(row.split()[1]) == pytest.approx(true, rel=0.03), parameter
    if name in NOISE:
        noise, unit = NOISE[name]
        (told,) = [text for text in texts if "FMPy and the record differ" in text]
        assert told.endswith(f"{unit}'")
        assert float(told.split()[-2]) == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_muscle_elongates_by_a_charge_as_the_rig_does(tmp_path: Path) -> None:
    """Whose law is none of the catalogue, so that it comes out of two terms together."""
    texts = texts_of("actuator", tmp_path)
    (told,) = [text for text in texts if "found and true elongation differ" in text]
    assert float(told.split()[-2]) < 3.0


def test_the_gallery_shows_a_tour_of_each_trade_first() -> None:
    pages = [GALLERY / "index.md", ROOT / "docs" / "index.md"]
    for page in pages:
        linked = re.findall(r"^\* \[.*\]\((?:gallery/)?(\w+)\.md\)", page.read_text("utf-8"), re.M)
        assert tuple(linked[-len(TOURS) :] if page is pages[1] else linked[: len(TOURS)]) == TOURS
    for name in TOURS:
        assert "\n## Handed over\n" in (GALLERY / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs_and_draws(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    cells = re.findall(r"^```\{code-cell\} python\n(.*?)^```$", text, re.M | re.S)
    assert cells
    assert len(cells) == text.count("{code-cell}")
    assert any("plt.subplots" in cell for cell in cells)
    for cell in cells:
        compile(re.sub(r"^%%.*", "", cell), path.name, "exec")
