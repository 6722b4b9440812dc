"""Claims: of a file that a user wrote its text is run, whatever Python keeps beside it."""

import importlib.util
import os
import pickle
import py_compile
import subprocess
import sys

import pytest

from fmus.kit import UserError, stack
from fmus.kit.build.package import python_package
from orchestration.fmu.model.loading import load_class

SOURCE = '''
from fmus.kit import Component, Output, Parameter


class Own(Component):
    """A model."""

    name = "own"
    gain = Parameter(GAIN, "1", min=0.0, max=9.0, doc="a gain")

    @Output("1")
    def y(self):
        """The gain."""
        return self.gain
'''


def gain(path):
    (parameter,) = (p for p in load_class(f"{path}:Own").layout.parameters if p.name == "gain")
    return parameter.start


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    (tmp_path / "own.py").write_text(SOURCE.replace("GAIN", "1.0"))
    return tmp_path / "own.py"


def test_bytecode_of_another_text_is_not_run(path):
    """Of the same size and the same second, which is all that Python looks at."""
    kept = path.with_name("elsewhere.py")
    kept.write_text(SOURCE.replace("GAIN", "2.0"))
    os.utime(path, (1e9, 1e9))
    os.utime(kept, (1e9, 1e9))
    py_compile.compile(str(kept), importlib.util.cache_from_source(str(path)), doraise=True)
    assert gain(path) == 1.0


def test_damaged_bytecode_is_in_nobodys_way(path):
    beside = importlib.util.cache_from_source(str(path))
    py_compile.compile(str(path), beside, doraise=True)
    with open(beside, "r+b") as file:
        file.truncate(40)
    assert gain(path) == 1.0


def test_ctrl_c_in_a_class_is_no_error_of_the_file(path):
    """Python 3.11 makes a RuntimeError of it."""
    pressed = "class Pressed:\n    def __set_name__(self, *_):\n        raise KeyboardInterrupt\n"
    path.write_text(f"{pressed}\n\nclass Own:\n    gain = Pressed()\n")
    with pytest.raises(KeyboardInterrupt):
        load_class(f"{path}:Own")


TWO = (
    SOURCE.replace("GAIN", "1.0")
    + """

class Other(Own):
    name = "other"


class Softer(Own):
    name = ""
"""
)


def test_a_file_without_its_class_tells_which_models_it_has(path):
    path.write_text(TWO, encoding="utf-8")
    with pytest.raises(UserError) as told:
        load_class(str(path))
    assert str(told.value) == f"{path}: name a class in it, such as {path}:Own, {path}:Other"


def test_a_file_without_models_says_so(path):
    path.write_text("from fmus.kit import Component\n", encoding="utf-8")
    with pytest.raises(UserError, match="there is no Component in it"):
        load_class(str(path))
    with pytest.raises(UserError, match=r"write path/to/file\.py:Class"):
        load_class(f"{path}:")


def test_a_pickle_needs_no_file(path):
    """It has the class as it was, whatever the file has become."""
    pickled = pickle.dumps(stack(load_class(f"{path}:Own"), defaults={"gain": 3.0}))
    path.unlink()
    script = "import pickle, sys; print(pickle.load(sys.stdin.buffer)().outputs())"
    run = subprocess.run([sys.executable, "-c", script], input=pickled, capture_output=True)
    assert (run.stdout.strip(), run.stderr) == (b"[3.0]", b"")


def test_a_pickle_of_a_file_that_changed_is_of_the_file_as_it_was(path):
    before = load_class(f"{path}:Own")
    path.write_text(SOURCE.replace("GAIN", "2.0"))
    after = load_class(f"{path}:Own")
    again = [pickle.loads(pickle.dumps(cls)) for cls in (before, after)]
    assert [cls().outputs() for cls in again] == [[1.0], [2.0]]


@pytest.fixture
def oven(tmp_path):
    """A folder with a model whose gain is twice a number in a file beside it."""
    (tmp_path / "tables.py").write_text("from numbers_of_oven import HALF\nSIZE = 2.0 * HALF\n")
    (tmp_path / "numbers_of_oven.py").write_text("HALF = 1.5\n")
    file = tmp_path / "own.py"
    file.write_text(f"from tables import SIZE\n{SOURCE.replace('GAIN', 'SIZE')}")
    return file


def test_a_file_imports_those_beside_it_and_nobody_else_does(oven, tmp_path):
    before = list(sys.path)
    assert gain(oven) == 3.0
    assert sys.path == before
    assert "tables" not in sys.modules
    assert importlib.util.find_spec("tables") is None
    # of another folder it is another file
    other = tmp_path / "other"
    other.mkdir()
    (other / "tables.py").write_text("SIZE = 7.0\n")
    (other / "own.py").write_text(oven.read_text())
    assert gain(other / "own.py") == 7.0


def test_a_file_that_changed_behind_those_beside_is_read_again(oven):
    assert load_class(f"{oven}:Own") is load_class(f"{oven}:Own")
    assert gain(oven) == 3.0
    (oven.parent / "numbers_of_oven.py").write_text("HALF = 2.0\n")
    assert gain(oven) == 4.0


def test_files_may_import_each_other(oven):
    oven.write_text(f"import tables\n{SOURCE.replace('GAIN', 'tables.size()')}")
    text = "import own\n\ndef size():\n    return 5.0 if own else 0.0\n"
    (oven.parent / "tables.py").write_text(text)
    assert gain(oven) == 5.0
    assert load_class(f"{oven}:Own") is load_class(f"{oven}:Own")


def test_what_a_file_beside_lacks_is_told_with_its_place(oven):
    (oven.parent / "tables.py").write_text("OTHER = 1.0\n")
    with pytest.raises(UserError, match=r"own\.py, line 1: .*'SIZE' from 'tables'"):
        load_class(f"{oven}:Own")
    (oven.parent / "tables.py").write_text("SIZE = \n")
    with pytest.raises(UserError, match=r"own\.py, line 1: .*tables\.py, line 1: SyntaxError"):
        load_class(f"{oven}:Own")


def test_files_beside_a_model_travel_in_a_python_fmu(oven):
    packed = python_package(load_class(f"{oven}:Own"))
    root = "resources/python/"
    for path, contents in packed.items():
        if path.startswith(root):
            target = oven.parent / "packed_oven" / path.removeprefix(root)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(contents)
    program = "import packed_oven; print(packed_oven.MODEL(gain=packed_oven.MODEL().gain).y())"
    for name in ("own", "tables", "numbers_of_oven"):
        (oven.parent / f"{name}.py").unlink()
    command = [sys.executable, "-c", program]
    run = subprocess.run(command, cwd=oven.parent, capture_output=True, text=True, check=True)
    assert float(run.stdout) == 3.0


def test_a_file_beside_that_cannot_travel_is_named(oven):
    oven.write_text(f"import tables\n{SOURCE.replace('GAIN', 'tables.SIZE')}")
    with pytest.raises(UserError, match=r"line 1: 'import tables' cannot .*'from module import"):
        python_package(load_class(f"{oven}:Own"))
