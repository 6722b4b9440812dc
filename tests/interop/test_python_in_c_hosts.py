"""The Python build in a host without Python runs the same in any thread and any environment, or
says no.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

from tests.support import hosts

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the hosts of the tests run on Linux"
)

TRIALS = 12
THREADS = 8
ACTUATOR, FOOT = "ppy_actuator", "foot"
TIMES = np.linspace(0.0, 1.0, 11)
BAD_EXIT = 97
# what the interpreter of another program may be told, and the modules it may find where it is told
# to look
SURROUNDINGS = {
    "home of nothing": ({"PYTHONHOME": "/nonexistent"}, {}),
    "home of nothing twice": ({"PYTHONHOME": "/nonexistent:/nowhere"}, {}),
    "path of nothing": ({"PYTHONPATH": "/nonexistent"}, {}),
    "sitecustomize that raises": (
        {"PYTHONPATH": "{here}"},
        {"sitecustomize.py": "raise SystemExit(97)"},
    ),
    "sitecustomize that ends": (
        {"PYTHONPATH": "{here}"},
        {"sitecustomize.py": "import os; os._exit(97)"},
    ),
    "usercustomize that ends": (
        {
            "PYTHONUSERBASE": "{here}",
            "PATH": "/usr/bin",
        },  # no virtual environment, which would shut it out
        {
            f"lib/python3.{sys.version_info.minor}/site-packages/usercustomize.py": (
                "import os; os._exit(97)"
            )
        },
    ),
    "module of the standard library that is none": (
        {"PYTHONPATH": "{here}"},
        {"dataclasses.py": "field = None"},
    ),
    "module that computes otherwise": (
        {"PYTHONPATH": "{here}"},
        {"math.py": "exp = log = sin = lambda x: 0.0"},
    ),
    "seed that is none": ({"PYTHONHASHSEED": "seed"}, {}),
    "optimized": ({"PYTHONOPTIMIZE": "2"}, {}),
    "warnings are errors": ({"PYTHONWARNINGS": "error", "PYTHONDEVMODE": "1"}, {}),
    "no UTF-8": ({"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}, {}),
}


@pytest.fixture(scope="module")
def thread_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host ``c/thread_host.c``."""
    program = tmp_path_factory.mktemp("thread_host") / "thread_host"
    command = [
        hosts.compiler(),
        "-std=c99",
        "-O2",
        f"-I{hosts.HEADERS}",
        str(hosts.TESTS / "c" / "thread_host.c"),
    ]
    subprocess.run(
        [*command, "-o", str(program), "-ldl", "-lpthread"], check=True, capture_output=True
    )
    return program


@pytest.fixture(scope="module")
def unzipped(fmu, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., list[str]]:
    """Arguments of the host for the Python builds of some components: library, GUID and resources
    of each.
    """
    folder = tmp_path_factory.mktemp("unzipped")

    def arguments(*names: str) -> list[str]:
        found: list[str] = []
        for name in names:
            here = folder / name
            if not here.exists():
                with zipfile.ZipFile(fmu(name, "python")) as archive:
                    archive.extractall(here)
            guid = fmpy.read_model_description(str(here), validate=False).guid
            found += [
                str(here / "binaries" / fmpy.platform / f"{name}.so"),
                guid,
                (here / "resources").as_uri(),
            ]
        return found

    return arguments


def real_output(fmu: Path) -> int:
    """Value reference of the first Real output."""
    variables = fmpy.read_model_description(str(fmu), validate=False).modelVariables
    return next(v.valueReference for v in variables if v.causality == "output" and v.type == "Real")


def last_value(fmu: Path, reference: int) -> float:
    """Return the last value of the variable with this value reference."""
    variables = fmpy.read_model_description(str(fmu), validate=False).modelVariables
    name = next(v.name for v in variables if v.valueReference == reference)
    return hosts.run_fmpy(fmu, TIMES, {}, [name])[name][-1]


# --- threads
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "names", [pytest.param((ACTUATOR,), marks=pytest.mark.slow), (ACTUATOR, FOOT)], ids="+".join
)
def test_first_instances_of_several_threads_start_python_once(fmu, thread_host, unzipped, names):
    # Eight threads stand at a barrier before they create their instances; in one trial out of
    # twelve at most a start without a lock went well.
    arguments = unzipped(*names)
    paths = [fmu(name, "python") for name in names]
    reference = real_output(paths[0])
    # each FMU alone, in this process, gives what every thread of its kind has to get
    alone = [last_value(path, reference) for path in paths]
    expected = [alone[k % len(names)] for k in range(THREADS)]
    for trial in range(TRIALS):
        done = subprocess.run(
            [str(thread_host), str(THREADS), str(reference), *arguments],
            capture_output=True,
            text=True,
            timeout=60,
            env={**os.environ, "PPY_LIBPYTHON": hosts.python_library()},
        )
        assert done.returncode == 0, f"trial {trial + 1}: {done.returncode} {done.stderr}"
        assert sorted(map(float, done.stdout.split())) == sorted(expected), f"trial {trial + 1}"


# --- environment
# --------------------------------------------------------------------------------------------------


def run(path: Path, **environment: str) -> dict[str, np.ndarray]:
    environment = {"PPY_LIBPYTHON": hosts.python_library()} | environment
    return hosts.run_c_host(
        path, TIMES, {"current": 1e-3}, ["voltage", "displacement"], environment=environment
    )


@pytest.mark.parametrize("surroundings", SURROUNDINGS)
def test_environment_of_the_host_changes_nothing(fmu, tmp_path, monkeypatch, surroundings):
    path = fmu(ACTUATOR, "python")
    expected = hosts.run_fmpy(path, TIMES, {"current": 1e-3}, ["voltage", "displacement"])
    variables, modules = SURROUNDINGS[surroundings]
    for name in [name for name in os.environ if name.startswith("PYTHON")]:
        monkeypatch.delenv(name)
    for name, text in modules.items():
        module = tmp_path / name
        module.parent.mkdir(parents=True, exist_ok=True)
        module.write_text(text + "\n")
    found = run(path, **{name: value.format(here=tmp_path) for name, value in variables.items()})
    for output, values in expected.items():
        assert np.array_equal(found[output], values), output


def test_program_named_python_in_the_search_path_is_not_asked(fmu, tmp_path):
    # An isolated Python that is not told its home goes by the python3 of the search path, and by
    # the installation that this one's virtual environment belongs to, here one without a standard
    # library.
    folder, library = tmp_path / "bin", tmp_path / "lib" / f"python3.{sys.version_info.minor}"
    folder.mkdir()
    library.mkdir(parents=True)
    (library / "os.py").write_text("")
    (folder / "python3").symlink_to(sys.executable)
    (tmp_path / "pyvenv.cfg").write_text(f"home = {folder}\n")
    found = run(fmu(ACTUATOR, "python"), PATH=f"{folder}:{os.environ['PATH']}")
    expected = run(fmu(ACTUATOR, "python"), PATH="/nonexistent")
    for output, values in expected.items():
        assert np.array_equal(found[output], values), output


def test_folder_with_any_name_works_in_a_locale_without_its_letters(fmu, tmp_path, monkeypatch):
    folder = tmp_path / "größe 日本"
    folder.mkdir()
    expected = run(fmu(ACTUATOR, "python"))
    monkeypatch.setattr(tempfile, "tempdir", str(folder))  # where the harness unzips FMUs
    found = run(fmu(ACTUATOR, "python"), LC_ALL="C")
    assert np.array_equal(found["voltage"], expected["voltage"])


def test_library_whose_standard_library_is_broken_is_refused_as_often_as_asked(
    thread_host, unzipped, tmp_path
):
    # Beside this copy is what looks like a standard library, and is none: Python gives up, the host
    # does not.
    version = f"3.{sys.version_info.minor}"
    library = tmp_path / "lib" / "libpython.so"
    (tmp_path / "lib" / f"python{version}").mkdir(parents=True)
    (tmp_path / "lib" / f"python{version}" / "os.py").write_text("")
    library.write_bytes(Path(hosts.python_library()).read_bytes())
    done = subprocess.run(
        [str(thread_host), str(THREADS), "0", *unzipped(ACTUATOR, FOOT)],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PPY_LIBPYTHON": str(library)},
    )
    said = [line for line in done.stderr.splitlines() if "no Python" in line]
    assert (done.returncode, len(said)) == (3, THREADS), done.stderr
    assert all(
        f"Python {version}, whose home is {tmp_path}, does not start: " in line for line in said
    )


# --- versions
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "version", ["3.10.4 (main, Jun  1 2022, 12:00:00) [GCC 11.2.0]", "2.7.18 (default)"]
)
def test_older_python_is_refused_before_it_is_asked_for_anything_else(fmu, tmp_path, version):
    # Every other function of this library ends the host.
    text = (Path(__file__).parents[2] / "fmus" / "kit" / "fmi" / "python.h").read_text()
    functions = set(re.findall(r"^    X\(.*?, (\w+),", text, re.M))
    assert "Py_IsInitialized" in functions
    source = tmp_path / "old.c"
    source.write_text(
        f'#include <stdlib.h>\nconst char *Py_GetVersion(void) {{ return "{version}"; }}\n'
        + "".join(f"void {name}(void) {{ _Exit({BAD_EXIT}); }}\n" for name in sorted(functions))
    )
    library = tmp_path / "libpython3.10.so"
    subprocess.run(
        [hosts.compiler(), "-shared", "-fPIC", str(source), "-o", str(library)], check=True
    )
    with pytest.raises(hosts.HostError) as caught:
        run(fmu(ACTUATOR, "python"), PPY_LIBPYTHON=str(library))
    assert caught.value.returncode == 3
    said = [line for line in caught.value.output.splitlines() if "no Python" in line]
    assert len(said) == 1
    number = version.split()[0]
    assert said[0].endswith(
        f"no Python: PPY_LIBPYTHON = {library} is Python {number}; Python 3.11 or newer is needed"
    )
