"""Claims: a figure is shown by a notebook without pyplot, and stays a figure of matplotlib."""

from __future__ import annotations

import subprocess
import sys

from matplotlib.figure import Figure

from orchestration.reporting import pictures
from orchestration.reporting.figure import rendered


def test_it_renders_itself():
    figure, _ = pictures.panels(1, "title")
    assert isinstance(figure, Figure)
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert rendered(figure, "svg").startswith(b"<?xml")


def test_pyplot_is_not_loaded():
    code = (
        "import sys; from orchestration.reporting import pictures;"
        " pictures.panels(1, '')[0]._repr_png_(); print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
