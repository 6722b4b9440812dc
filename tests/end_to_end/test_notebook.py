"""Claims: in a notebook every result is shown as tables, with its picture where it has one.

A kernel of Jupyter runs one notebook with all kinds of results; what it keeps is looked at as a
notebook's reader would: by the standard library alone.
"""

from __future__ import annotations

import base64
from html.parser import HTMLParser

import nbformat
import pytest
from nbclient import NotebookClient

from tests.support.hosts import build_one_state_fmu

PNG = b"\x89PNG\r\n\x1a\n"
LAG = '''
"""A lag."""

from fmus.kit import Component, Input, Parameter, State


class Lag(Component):
    """A lag of the first order."""

    name = "lag"
    tau = Parameter(1.0, "s", min=1e-3, doc="time constant")
    u = Input("1", start=0.0, doc="what it follows")
    x = State("1", rate="falling_short", output=True, doc="what follows")

    def falling_short(self):
        """Return the rate."""
        return (self.u - self.x) / self.tau
'''
SETUP = """
import sys

import numpy as np

import ppy_rig as ppy
from orchestration.system import Member, Port, System

step = 0.1
time = step * np.arange(400)
u = np.repeat([1.0, -2.0, 0.5, 3.0, -1.0, 2.0, 0.0, 1.0], 50)


def follow(u, tau):
    x = np.zeros(400)
    for k in range(399):
        x[k + 1] = u[k] + (x[k] - u[k]) * np.exp(-step / tau)
    return x


noise = np.random.default_rng(1).normal(0.0, 0.02, 400)


def write(name, u, x):
    rows = np.column_stack([time, u, x])
    np.savetxt(name, rows, delimiter=",", header="time [s],u [1],x [1]", comments="")


write("lag.csv", u, follow(u, 0.8) + noise)
write("lags.csv", u, follow(follow(u, 0.5), 0.8) + noise)
two = np.repeat([0.0, 1.0, 0.0, 1.0], 100)
write("two.csv", two, follow(follow(two, 0.5), 0.8) + 5.0 * noise)
model = "lag.py:Lag"
fmu = "one_state.fmu"
"""
# what is called, and whether it has a picture
RESULTS = {
    "record": ('record = ppy.read_record("lag.csv", model); record', True),
    "model": ("ppy.find_model(model)", False),
    "simulation": ('ppy.simulate(model, {"u": 1.0}, stop="10s", step="100 ms")', True),
    "comparison": ('ppy.compare(record, model, fit="tau")', True),
    "fit": ('fitted = ppy.fit(record, model, "tau"); fitted', True),
    "profile": ('fitted.profile("tau")', True),
    "frequency response": ('ppy.frequency_response("lag.csv", model)', True),
    "black box": (
        'ppy.black_box("lag.csv", "x", structures="ARX", path_orders=[1], noise_orders=[1])',
        True,
    ),
    "diagnosis": ('found = ppy.diagnose("lags.csv", model, effects="input_lag(u)"); found', True),
    "evidence": ("found.evidence", True),
    "laws": ("ppy.laws(record, model)", False),
    "experiment": ('ppy.diagnose("two.csv", model).experiment', True),
    "sweep": ('over = {"tau": "0.5..2", "u": "1..3"}; ppy.sweep(fmu, {"tau": "0.5..2:5"})', True),
    "front": ('ppy.optimise(model, {"tau": "0.5..2"}, maximise="x", stop=1.0)', True),
    "tornado": ('ppy.tornado(ppy.sweep(fmu, over, kind="tornado", settings={"u": 2.0}))', True),
    "sensitivity": (
        'ppy.sensitivity(ppy.sweep(fmu, over, kind="sobol-indices", samples=16))',
        True,
    ),
    "bands": (
        'ppy.bands(ppy.sweep(fmu, over, kind="sobol", samples=16, keep="trace"))',
        True,
    ),
    "run": ('ppy.run("lag.toml")', True),
    "system": (
        'member = Member("one", ppy.find_model(fmu).path, {})\n'
        'system = System("lags", (member,), (), {"u": (Port("one", "u"),)})\n'
        'ppy.run(system, time, {"u": u})',
        True,
    ),
    "check": ("ppy.check(fmu)", False),
}
FIGURES = {
    "figure": "record.plot()",
    "text": "text = str(found); text.splitlines()[0]",
    "pyplot": '"matplotlib.pyplot" in sys.modules',
    "error": 'ppy.read_record("lag.csv", "ppy_actuator")',
}


class Tables(HTMLParser):
    """Counts elements, and the cells that have a text."""

    def __init__(self, text: str):
        super().__init__()
        self.cells = 0
        self.images = 0
        self.elements: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.add(tag)
        self.images += tag == "img"

    def handle_data(self, data):
        self.cells += bool(data.strip())


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """Run all cells in one kernel; return the outputs of each by name."""
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "lag.py").write_text(LAG, encoding="utf-8")
    (folder / "lag.toml").write_text('component = "lag.py:Lag"\nduration = 5\nstep = 0.1\n')
    build_one_state_fmu(folder)
    calls = {name: call for name, (call, _) in RESULTS.items()} | FIGURES
    cells = [SETUP, *calls.values()]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(c) for c in cells])
    notebook.cells[-1].metadata["tags"] = ["raises-exception"]
    client = NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": folder}}
    )
    client.execute()
    shown = []
    for cell in notebook.cells[1:]:  # without what is left of a bar
        shown.append([one for one in cell.outputs if one.get("data") != {"text/plain": ""}])
    return dict(zip(calls, shown, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_shown_as_html_and_as_its_picture(shown, name):
    (output,) = shown[name]  # and nothing is printed beside it
    data = output.data
    page = Tables(data["text/html"])
    assert "pre" not in page.elements or "xr-wrap" in data["text/html"]
    assert page.cells >= 1
    has_picture = RESULTS[name][1]
    assert page.images == has_picture
    assert ("image/png" in data) == has_picture
    if has_picture:
        assert base64.b64decode(data["image/png"]).startswith(PNG)
        assert data["image/png"].replace("\n", "") in data["text/html"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in RESULTS if name not in ("laws", "experiment")])
def test_a_result_has_a_table(shown, name):
    html = shown[name][0].data["text/html"]
    assert "<table" in html or "xr-var-list" in html or name == "profile"


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in RESULTS if n not in ("sweep", "run", "bands")])
def test_a_repr_is_a_line(shown, name):
    text = shown[name][0].data["text/plain"]
    assert len(text) < 120 or "xarray" in text
    assert "\n" not in text or "xarray" in text


@pytest.mark.slow
def test_a_figure_shows_itself_without_pyplot(shown):
    (figure,) = shown["figure"]
    assert base64.b64decode(figure.data["image/png"]).startswith(PNG)
    assert shown["pyplot"][0].data["text/plain"] == "False"


@pytest.mark.slow
def test_a_text_is_a_text_and_prints_nothing(shown):
    """In a notebook, rich would show its tables at once, and leave the text without them."""
    (text,) = shown["text"]
    assert text.output_type == "execute_result"


@pytest.mark.slow
def test_a_message_says_what_python_is_told(shown):
    (error,) = shown["error"]
    assert error.ename == "UserError"
    assert "mapping={" in error.evalue
    assert "--map" not in error.evalue
