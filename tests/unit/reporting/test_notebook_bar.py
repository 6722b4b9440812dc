"""Claims: in a notebook progress is one line below the cell, which is empty in the end."""

from __future__ import annotations

import nbformat
import pytest
from nbclient import NotebookClient

from orchestration.reporting.notebook_bar import in_kernel

CELLS = (
    """
import time
from orchestration.reporting.console import bar
from orchestration.reporting.notebook_bar import NotebookBar

running = NotebookBar("fitting")
time.sleep(1.01)
running("simulating <em>")
time.sleep(0.11)
running.done(7, 28)
""",
    """
with bar("sweep") as tell:
    time.sleep(1.01)
    for k in range(1000):
        tell.done(k, 1000)
""",
    """
with bar("sweep") as tell:
    tell.done(7, 28)
""",
)


def test_a_process_is_no_kernel():
    assert not in_kernel()


@pytest.mark.slow
def test_progress_is_one_output_of_a_cell(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(c) for c in CELLS])
    NotebookClient(notebook, resources={"metadata": {"path": tmp_path}}).execute()
    running, ended, short = ([output.data for output in cell.outputs] for cell in notebook.cells)
    assert [data["text/plain"] for data in running] == ["simulating <em> (7 of 28)"]
    assert running[0]["text/html"] == (
        '<progress max="28" value="7"></progress> simulating &lt;em&gt; (7 of 28)'
    )
    assert [dict(data) for data in ended] == [{"text/plain": ""}]
    assert short == []
