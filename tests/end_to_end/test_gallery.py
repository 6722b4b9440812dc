"""Claims: a notebook of the gallery runs as a reader runs it, and says what its text says.

All of them run when the site is built (`test_site.py`); one runs here.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.site import ROOT

GALLERY = ROOT / "docs" / "gallery"
NOTEBOOKS = sorted(path for path in GALLERY.glob("*.md") if path.stem != "index")


def executed(path: Path, folder: Path) -> list[dict]:
    """Outputs of a notebook that runs in a folder of its own."""
    nbclient = pytest.importorskip("nbclient", reason="no tools of the documentation")
    from myst_nb.core.read import read_myst_markdown_notebook
    from myst_parser.config.main import MdParserConfig

    notebook = read_myst_markdown_notebook(path.read_text(encoding="utf-8"), MdParserConfig())
    resources = {"metadata": {"path": str(folder)}}
    nbclient.NotebookClient(notebook, timeout=60, resources=resources).execute()
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


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs_and_draws(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    cells = re.findall(r"^```\{code-cell\} python\n(.*?)^```$", text, re.M | re.S)
    assert cells
    assert len(cells) == text.count("{code-cell}")
    assert any("plt.subplots" in cell for cell in cells)
    for cell in cells:
        compile(re.sub(r"^%%.*", "", cell), path.name, "exec")
