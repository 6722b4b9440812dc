"""Code in the documentation runs: console blocks through a shell, python blocks as scripts, in order, in one folder.

An output block is an excerpt of what the commands before it printed. With ``PPY_WRITE_DOCS`` set, its numbers are
written anew.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.kit.build.toolchain import host_platform

ROOT = Path(__file__).parents[2]
PAGES = [
    "docs/tutorial.md",
    "docs/reference/master.md",
    *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs" / "how-to").glob("*.md"))),
]
BLOCK = re.compile(r"^```(console|python|output)\n(.*?)^```", re.M | re.S)
NUMBER = re.compile(r"(?<![\w-])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def run(command: list[str] | str, folder: Path) -> str:
    bin_folder = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": os.pathsep.join([bin_folder, os.environ["PATH"]]), "COLUMNS": "120"}
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


def words(line: str) -> list[str]:
    """What a line says, whatever its numbers and its columns."""
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


@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_runs(page: str, tmp_path: Path) -> None:
    contents = (ROOT / page).read_text(encoding="utf-8")
    blocks = BLOCK.findall(contents)
    assert blocks, f"{page} shows nothing that runs"
    shutil.copytree(ROOT / "examples", tmp_path / "examples")  # beside which a reader works
    printed = ""
    script = tmp_path / "page.py"
    script.write_text("", encoding="utf-8")
    for language, text in blocks:
        if language == "python":  # a later block goes on from the earlier ones
            script.write_text(script.read_text(encoding="utf-8") + text, encoding="utf-8")
            run([sys.executable, script.name], tmp_path)
            continue
        if language == "output":
            pairs = excerpt(text, printed)
            if "PPY_WRITE_DOCS" in os.environ:
                for shown, now in pairs:
                    contents = contents.replace(f"{shown}\n", f"{now}\n")
                (ROOT / page).write_text(contents, encoding="utf-8")
            else:  # another machine rounds otherwise
                for shown, now in pairs:
                    assert numbers(shown) == pytest.approx(numbers(now), rel=0.01), f"{page}: {shown!r}, {now!r}"
            continue
        printed = ""
        for line in text.splitlines():
            assert line.startswith("$ "), f"{page}: a console block holds commands only, found {line!r}"
            printed += run(line[2:].replace("--platforms linux64", f"--platforms {host_platform()}"), tmp_path)


def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    section = (ROOT / "README.md").read_text(encoding="utf-8").split("## Use it")[1].split("## ")[0]
    commands = re.findall(r"^ppy .*$", section, re.M)
    assert len(commands) >= 6
    run("ppy demo", tmp_path)
    for command in commands:
        command = command.split("  #")[0].rstrip()
        run(f"{command} --platforms {host_platform()}" if command == "ppy build" else command, tmp_path)


@pytest.mark.parametrize(
    "page", [Path("README.md"), *(p.relative_to(ROOT) for p in sorted((ROOT / "docs").rglob("*.md")))], ids=str
)
def test_links_lead_somewhere(page: Path) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        if "://" not in target:
            assert (ROOT / page.parent / target).exists(), f"{page}: {target}"
