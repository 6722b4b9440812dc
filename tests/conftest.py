"""Fixtures of all tests: FMUs built once, and the folder of public records."""

from __future__ import annotations

import os

# as many workers as cores and one more share them; before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# each Python that a test starts would compile our modules anew
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import gc
import shutil
import signal
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import settings

from fmus import COMPONENTS, component
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform

# their assertions explain themselves, too
pytest.register_assert_rewrite("tests.contract", "tests.support")

from tests.support.pace import is_repetition  # noqa: E402
from tests.support.parts import VARIABLE, split  # noqa: E402
from tests.support.processor_time import ProcessorTimeLimit  # noqa: E402
from tests.support.punctual import Watch  # noqa: E402

pytest_plugins = ["pytester"]

PUBLIC_DATA = Path(os.environ.get("PPY_PUBLIC_DATA", Path(__file__).parents[2] / "shared" / "data"))


# an example may take long on a machine that does other work; each run draws other examples
settings.register_profile("ppy", deadline=None, max_examples=50)
settings.load_profile("ppy")
_watch = Watch()
# where the suite was started in the background or by nohup, nobody hears Ctrl-C or SIGHUP, nor does
# what tests start: they send them themselves
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_configure(config: pytest.Config) -> None:
    """Refuse an installation that is older than the entry points; limit the processor time of each
    test, unless coverage is measured, which takes its own.
    """
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    for group, declared in project["entry-points"].items():
        if not declared.keys() <= entry_points(group=group).names:
            raise pytest.UsageError(f"{group}: pip install -e . --no-deps installs what is new")
    if not config.pluginmanager.hasplugin("_cov"):
        config.pluginmanager.register(ProcessorTimeLimit())


def pytest_itemcollected(item: pytest.Item) -> None:
    """Leave to the slow tests those that need a browser, and what others show."""
    is_repeated = hasattr(item, "callspec") and is_repetition(item.callspec.params)
    if is_repeated or "browser" in getattr(item, "fixturenames", ()):
        item.add_marker(pytest.mark.slow)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the tests of other parts where one part of the suite is run.

    Files that take long come first, or one worker runs them alone at the end.
    """
    items.sort(key=lambda item: "end_to_end" not in item.path.parts)
    if VARIABLE in os.environ:
        items[:], others = split(items, os.environ[VARIABLE])
        config.hook.pytest_deselected(items=others)


def pytest_collection_finish() -> None:
    """Keep what lives until the end out of every collection of garbage; a run in real time begins
    with one.
    """
    gc.collect()
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Watch the machine where a test is about milliseconds."""
    if item.get_closest_marker("real_time"):
        _watch.start()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Do not judge a test about milliseconds that failed while the machine did not keep real
    time.
    """
    outcome = yield
    report = outcome.get_result()
    mark = item.get_closest_marker("real_time")
    judged = report.when != "call" or report.passed or mark is None
    pause = 0.0 if judged else _watch.longest(call.start, call.stop, **mark.kwargs)
    if pause:
        report.outcome = "skipped"
        reason = f"Skipped: not judged, the machine paused for {1e3 * pause:.0f} ms: "
        report.longrepr = (*item.location[:2], reason + str(call.excinfo.value)[:200])


def pytest_unconfigure() -> None:
    """Stop watching."""
    _watch.stop()


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Path of a component's FMU for this platform, built once a session for all workers:
    ``fmu(name, runtime)``, of FMI 3.0 ``fmu(name, runtime, 3)``.
    """
    base = tmp_path_factory.getbasetemp()
    is_worker = "PYTEST_XDIST_WORKER" in os.environ
    folder = (base.parent if is_worker else base) / "fmus"

    def path(name: str, runtime: str, fmi: int = 2) -> Path:
        file = folder / f"{runtime}-{fmi}" / f"{name}.fmu"
        file.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(f"{file}.lock"):
            if not file.exists():
                unfinished = file.with_suffix(".part")
                unfinished.write_bytes(build(component(name), runtime, [host_platform()], fmi=fmi))
                unfinished.rename(file)
        return file

    return path


@pytest.fixture(params=RUNTIMES)
def runtime(request: pytest.FixtureRequest) -> str:
    """Each of the two builds in turn."""
    return request.param


@pytest.fixture(params=COMPONENTS)
def name(request: pytest.FixtureRequest) -> str:
    """Each component in turn."""
    return request.param


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, for this test alone."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture(scope="session")
def browser() -> str:
    """Path of a browser; skips where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    for path in filter(None, map(shutil.which, names)):
        return path
    pytest.skip(f"no browser here: none of {', '.join(names)} is installed")


@pytest.fixture(scope="session")
def public_data() -> Callable[[str], Path]:
    """Path of a public record; skips where it is absent."""

    def path(name: str) -> Path:
        file = PUBLIC_DATA / name
        if not file.exists():
            pytest.skip(f"public record {name} is not in {PUBLIC_DATA} (set PPY_PUBLIC_DATA)")
        return file

    return path
