"""Code in the documentation runs: console blocks through a shell, python blocks in one Python, in
order, in one folder.

An output block is an excerpt of what the commands before it printed. With ``PPY_WRITE_DOCS`` set,
its numbers are written anew. Modules, files and options that any page names exist.

Pages whose blocks take ten seconds or more are run by `make test-slow`: the tutorial, the commands
of the readme, and those in ``HEAVY``.
"""

import contextlib
import itertools
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer

from fmus.kit.build.toolchain import host_platform
from orchestration.cli import app as cli
from tests.support import source
from tests.support.installed import OTHER_COMPONENTS, install
from tests.support.rig.process import Server

ROOT = source.ROOT
HEAVY = {
    "linearise",
    "design",
    "frequency",
    "diagnose",
    "stance",
    "systems",
    "work-loops",
    "own-record",
    "hardware-in-the-loop",
    "commission",
    "thesis",
    "laws",
    "identify",
    "characterise",
    "ageing",
    "sweeps",
    "retune",
    "continuous-integration",
    "new-component",
    "own-components",
    "other-tools",
}
PAGES = [
    pytest.param("docs/tutorial.md", marks=pytest.mark.slow),
    pytest.param("docs/reference/master.md", marks=pytest.mark.real_time),
    *(
        pytest.param(str(p.relative_to(ROOT)), marks=pytest.mark.slow if p.stem in HEAVY else ())
        for p in sorted((ROOT / "docs" / "how-to").glob("*.md"))
        if p.stem != "index"  # a list of the others
    ),
]
BLOCK = re.compile(r"^```(console|python|output)\n(.*?)^```", re.M | re.S)
FOLDERS = (
    "docs",
    "fmus",
    "orchestration",
    "ppy_rig",
    "demonstrations",
    "studies",
    "benchmarks",
    "tests",
    "examples",
)
MARKDOWN = sorted(
    path.relative_to(ROOT)
    for pattern in ("*.md", *(f"{folder}/**/*.md" for folder in FOLDERS))
    for path in ROOT.glob(pattern)
)
ENTRY_POINTS = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"])
DOTTED = re.compile(
    r"(?<![\w./])(?:orchestration|ppy_rig|fmus|studies|tests|benchmarks)(?:\.\w+)+(?![\w/])"
)
PATH = re.compile(rf"(?<![\w./-])(?:(?:{'|'.join(FOLDERS)})/[\w./-]*|\.ci/\w+)")
PYTHON_FILE = re.compile(rf"(?<![\w./])(?!(?:{'|'.join(FOLDERS)})/)[\w/]+\.py(?![\w/])")
THE_READERS = {
    "file.py",
    "path/to/file.py",
    "own.py",
    "models.py",
    "cell.py",
    "controller.py",
    "loop/controller.py",
    "leak.py",
    "oven.py",
    "room.py",
    "tank.py",
    "test_oven.py",
    "test_tank.py",
}  # files that a reader would write
SCRIPTS = ("benchmarks", "studies", "tests")  # folders
OTHER_PROGRAMS = {"python", "pip", "pytest", "git", "make", "pre-commit"}
NUMBER = re.compile(r"(?<![\w-])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def run(command: list[str] | str, folder: Path) -> str:
    bin_folder = str(Path(sys.executable).parent)
    environment = os.environ | {
        "PATH": os.pathsep.join([bin_folder, os.environ["PATH"]]),
        "COLUMNS": "120",
    }
    if command == f"pip install ./{OTHER_COMPONENTS.name}":
        install(OTHER_COMPONENTS, folder / "site")
        return ""
    if (folder / "site").is_dir():
        environment["PYTHONPATH"] = str(folder / "site")
    done = subprocess.run(
        command,
        cwd=folder,
        shell=isinstance(command, str),
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


BLOCKS = """
import sys
for name in sys.stdin:
    with open(name.strip(), encoding="utf-8") as block:
        exec(compile(block.read(), name.strip(), "exec"))
    print("\\0", file=sys.stderr, flush=True)
"""


@contextlib.contextmanager
def python(folder: Path) -> Iterator[Callable[[str], None]]:
    """Run blocks in one Python, each when it is asked for: a later one goes on from those before
    it.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", BLOCKS],
        cwd=folder,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stderr is not None
    count = itertools.count(1)

    def run_block(text: str) -> None:
        name = f"block_{next(count)}.py"
        (folder / name).write_text(text, encoding="utf-8")
        print(name, file=process.stdin, flush=True)
        told = []
        for line in process.stderr:
            if line == "\0\n":
                return
            told.append(line)
        raise AssertionError("".join([text, *told]))

    with process:
        try:
            yield run_block
        except BaseException:
            process.kill()
            raise
        process.stdin.close()
        assert process.wait(60) == 0


def words(line: str) -> list[str]:
    """Return the words of a line, without its numbers and columns."""
    return NUMBER.sub("#", line).split()


def excerpt(block: str, printed: str) -> list[tuple[str, str]]:
    """Every line of an output block, and the line printed that says the same but for numbers."""
    pairs = []
    for line in filter(str.strip, block.splitlines()):
        same = [other.rstrip() for other in printed.splitlines() if words(other) == words(line)]
        assert len(same) == 1, f"{line!r} was printed {len(same)} times in\n{printed}"
        pairs.append((line, same[0]))
    return pairs


def numbers(line: str) -> list[float]:
    return [float(text) for text in NUMBER.findall(line)]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_runs(page: str, tmp_path: Path) -> None:
    contents = (ROOT / page).read_text(encoding="utf-8")
    blocks = BLOCK.findall(contents)
    assert blocks, f"{page} shows nothing that runs"
    shutil.copytree(ROOT / "examples", tmp_path / "examples")  # beside which a reader works
    with python(tmp_path) as run_block:
        run_blocks(page, contents, tmp_path, run_block)


def run_blocks(page: str, contents: str, tmp_path: Path, run_block: Callable[[str], None]) -> None:
    """Run the blocks of a page in a folder."""
    printed = ""
    for language, text in BLOCK.findall(contents):
        if language == "python":
            run_block(text)
            continue
        if language == "output":
            pairs = excerpt(text, printed)
            if "PPY_WRITE_DOCS" in os.environ:
                for shown, now in pairs:
                    contents = contents.replace(f"{shown}\n", f"{now}\n")
                (ROOT / page).write_text(contents, encoding="utf-8")
            else:  # another machine rounds otherwise
                for shown, now in pairs:
                    assert numbers(shown) == pytest.approx(numbers(now), rel=0.01), (
                        f"{page}: {shown!r}, {now!r}"
                    )
            continue
        printed = ""
        for line in text.splitlines():
            assert line.startswith("$ "), (
                f"{page}: a console block holds commands only, found {line!r}"
            )
            printed += run(
                line[2:].replace("--platforms linux64", f"--platforms {host_platform()}"), tmp_path
            )


def test_the_readme_is_two_screens() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 80


def test_the_readme_begins_with_a_claim_a_picture_and_two_commands() -> None:
    """Within half a screen, before any section."""
    first = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## ")[0]
    assert len(first.splitlines()) <= 25
    parts = [first.index(begin) for begin in ("**Your ", "![", "```sh\n")]
    assert parts == sorted(parts)
    (commands,) = re.findall(r"```sh\n(.*?)```", first, re.S)
    assert len(commands.splitlines()) == 2


@pytest.mark.slow
def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    section = (ROOT / "README.md").read_text(encoding="utf-8").split("## Use it")[1].split("## ")[0]
    commands = re.findall(r"^ppy .*$", section, re.M)
    assert len(commands) >= 6
    run("ppy demo", tmp_path)
    for command in commands:
        run(command.split("  #")[0].rstrip(), tmp_path)
    for language, text in BLOCK.findall(section):
        assert language == "python"
        run([sys.executable, "-c", text], tmp_path)


@pytest.mark.slow
def test_the_rig_of_the_readme_is_in_the_loop(tmp_path: Path) -> None:
    """Demo and live view, which open a page, are run by tests of their own."""
    section = (
        (ROOT / "README.md")
        .read_text(encoding="utf-8")
        .split("## With a rig in the loop")[1]
        .split("\n## ")[0]
    )
    commands = [
        line.split("  #")[0].rstrip(" &") for line in re.findall(r"^ppy .*$", section, re.M)
    ]
    demo, serve, watch, loop = commands
    assert (demo, watch) == ("ppy rig demo", "ppy rig watch")
    patient = ("--watchdog", "5")  # the machine may be busy
    with Server(
        tmp_path, "emulator", *serve.removeprefix("ppy rig serve").split(), *patient
    ) as server:
        command = f"{loop} --set duration=1s --set proxy.endpoint={server.wait_ready()}"
        try:
            run(command, tmp_path)
        except AssertionError as error:
            if not_held := re.search("this machine does not hold .*", str(error)):
                pytest.skip(not_held[0])
            raise


def failures(check: Callable[[Path], Iterable[str]]) -> list[str]:
    """Page and text of all that a check finds on any page."""
    return [f"{page}: {text}" for page in MARKDOWN for text in check(page)]


def dead_links(page: Path) -> Iterator[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        if "://" not in target and not (ROOT / page.parent / target).exists():
            yield target


def test_links_lead_somewhere() -> None:
    assert failures(dead_links) == []


# --- names in prose and code
# ------------------------------------------------------------------------------------------


def unknown_names(page: Path) -> Iterator[str]:
    """Dotted names to the last attribute; paths from the root of the project, or, if a file of
    Python, to any depth.
    """
    text = (ROOT / page).read_text(encoding="utf-8")
    dotted = {name for name in DOTTED.findall(text) if not name.endswith((".md", ".py"))}
    yield from (name for name in dotted - ENTRY_POINTS if not source.exists(name))
    paths = {path.rstrip(".") for path in PATH.findall(text)}
    yield from (path for path in paths if not (ROOT / path).exists())
    known = [*source.modules().values(), *(ROOT / "examples").glob("*.py")]
    ours = {parent for p in known for parent in endings(p.relative_to(ROOT).as_posix())}
    yield from set(PYTHON_FILE.findall(text)) - THE_READERS - ours


def endings(path: str) -> Iterator[str]:
    """A path, without its first folder, and so on down to its file."""
    parts = path.split("/")
    yield from ("/".join(parts[k:]) for k in range(len(parts)))


@pytest.mark.slow
def test_modules_and_files_that_a_page_names_exist() -> None:
    assert failures(unknown_names) == []


def options(command: Any) -> dict[str, set[str]]:
    """Options of a command and of those below it, by the words that call it."""
    found = {
        "": {option for p in command.params for option in (*p.opts, *p.secondary_opts)} | {"--help"}
    }
    for name in command.list_commands(None) if hasattr(command, "list_commands") else ():
        below = options(command.get_command(None, name))
        found |= {f"{name} {words}".strip(): flags for words, flags in below.items()}
    return found


def commands_of(text: str) -> list[str]:
    """Lines of code blocks and code between backticks; one for each program that they call."""
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, re.M | re.S)
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [
        part.strip()
        for line in [*lines, *spans]
        for part in re.split(r"&&|[;|]| {2,}#", line.removeprefix("$ "))
    ]


@cache
def known_options() -> dict[str, set[str]]:
    """Options by the words that call a command of ours, and by the folder of a script."""
    known = options(typer.main.get_command(cli.app))
    for folder in SCRIPTS:
        sources = [path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob("*.py")]
        known[folder] = {
            option for text in sources for option in re.findall(r'"(--[a-z-]+)"', text)
        }
    return known


def allowed_options(line: str) -> set[str]:
    """With a command before it an option is one of that command, else of any."""
    known = known_options()
    program, *words = line.removeprefix(".venv/bin/").removeprefix("python -m ").split() or [""]
    if (folder := program.split(".")[0]) in SCRIPTS:
        return known[folder]
    if program == "ppy":
        words = [word for word in words if not word.startswith("-")]
        command = next((c for n in (2, 1) if (c := " ".join(words[:n])) in known), "")
        return known[""] | known[command]
    return set.union(*known.values())


def unknown_options(page: Path) -> Iterator[str]:
    """Lines with an option that is not allowed; those of other programs are left alone."""
    for line in commands_of((ROOT / page).read_text(encoding="utf-8")):
        flags = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", line))
        program = line.removeprefix(".venv/bin/").removeprefix("python -m ").partition(" ")[0]
        if flags and program not in OTHER_PROGRAMS and not flags <= allowed_options(line):
            yield line


def test_options_that_a_page_names_exist() -> None:
    assert failures(unknown_options) == []


def test_a_name_that_is_not_there_would_be_noticed() -> None:
    assert source.exists("orchestration.fmu.model.find_model")
    assert not source.exists("orchestration.fmu.model.find_models")
    assert not source.exists("orchestration.fmus")
    known = options(typer.main.get_command(cli.app))
    assert "--plot" in known["simulate"]
    assert "--connectors" in known["system export"]
    assert "--connectors" not in known["simulate"]
    assert commands_of("`ppy run x --out y`\n```sh\nppy list && \\\nppy build  # all\n```\n") == [
        "ppy list",
        "ppy build",
        "all",
        "ppy run x --out y",
    ]
