"""Claims: the page of the Python interface is that of its docstrings, every public name has an
example, and it runs.
"""

from __future__ import annotations

import doctest
import inspect
import shutil
from pathlib import Path

import pytest

import orchestration
from demonstrations.records import draw, write
from docs import make_python_reference as reference
from orchestration.system import Member, System
from tests.support.pace import slow_but

NAMES = (
    "read_record",
    "find_model",
    "simulate",
    "compare",
    "fit",
    "diagnose",
    "check",
    "build",
    "System",
    "run",
)
HEAVY = {"diagnose", "laws"}  # their examples take seconds
WITH_EXAMPLE = [n for n in orchestration.__all__ if n not in ("UserError", "__version__")]
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def sample(path: str, count: int = 1) -> int:
    """Say something in ``code``.

    More about it, see :func:`other`.

    Parameters
    ----------
    path : str
        Where it is,
        in two lines.
    count : int, optional
        How many.

    Returns
    -------
    int
        The number.

    Raises
    ------
    ValueError
        If there is none.

    Examples
    --------
    >>> 1 + 1
    2
    """
    return count


SAMPLE = """\
## sample

```python
sample(path, count=1)
```

Say something in `code`.

More about it, see `other`.

**Parameters**

* `path` : str
  Where it is,
  in two lines.
* `count` : int, optional
  How many.

**Returns**

* int
  The number.

**Raises**

* `ValueError`
  If there is none.

```pycon
>>> 1 + 1
2
```
"""


def test_a_docstring_becomes_markdown() -> None:
    assert reference.page({"sample": sample}).split("(#sample)\n\n")[1] == SAMPLE


def test_a_class_brings_its_methods_and_properties() -> None:
    text = reference.page({"System": System, "Member": Member})
    assert "**Attributes**\n\n* `name, doc` : str\n" in text
    assert "### System.member\n\n```python\nSystem.member(name)\n```\n" in text
    assert (
        "### Member.of\n\n```python\nMember.of(name, component, parameters=None,"
        ' runtime="native")\n```\n' in text
    )


def test_what_cannot_be_written_is_left_out_of_a_signature() -> None:
    assert reference.signature(lambda a, b=print, *, c=1: None) == "(a, b=..., *, c=1)"


def test_the_front_door_is_open() -> None:
    assert set(NAMES) <= set(orchestration.__all__) <= set(dir(orchestration))


def test_the_page_is_up_to_date() -> None:
    page = reference.PAGE.read_text(encoding="utf-8")
    assert page == reference.page(reference.public()), "run python docs/make_python_reference.py"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the examples: an emulated record with an effect hidden in it, another of
    the same rig, and the examples.
    """
    path = tmp_path_factory.mktemp("examples")
    write(draw("strain_saturation", 1), path / "hidden.csv")
    write(draw(None, 1, duration=300.0, changed={"R1": 1.4}, spread=0.0), path / "record.csv")
    shutil.copytree(reference.ROOT / "examples", path / "examples")
    return path


@pytest.mark.parametrize(
    "name",
    slow_but(WITH_EXAMPLE, *(name for name in WITH_EXAMPLE if name not in HEAVY)),
)
def test_an_example_runs(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    thing = getattr(orchestration, name)
    found = doctest.DocTestFinder().find(
        thing, name, module=inspect.getmodule(thing), globs={"ppy": orchestration}
    )
    assert any(test.examples for test in found), f"{name} has no example"
    said: list[str] = []
    for test in found:
        runner = doctest.DocTestRunner(optionflags=FLAGS)
        assert runner.run(test, out=said.append).failed == 0, "".join(said)
