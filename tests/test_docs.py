"""Code in the documentation runs: console blocks through a shell, python blocks as scripts, in order, in one folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.kit.toolchain import host_platform

ROOT = Path(__file__).parents[1]
PAGES = [
    "docs/tutorial.md",
    "docs/reference/master.md",
    *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs" / "how-to").glob("*.md"))),
]
BLOCK = re.compile(r"^```(console|python)\n(.*?)^```", re.M | re.S)


def run(command: list[str] | str, folder: Path) -> None:
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


@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_runs(page: str, tmp_path: Path) -> None:
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    assert blocks, f"{page} shows nothing that runs"
    script = tmp_path / "page.py"
    script.write_text("", encoding="utf-8")
    for language, text in blocks:
        if language == "python":  # a later block goes on from the earlier ones
            script.write_text(script.read_text(encoding="utf-8") + text, encoding="utf-8")
            run([sys.executable, script.name], tmp_path)
            continue
        for line in text.splitlines():
            assert line.startswith("$ "), f"{page}: a console block holds commands only, found {line!r}"
            run(line[2:].replace("--platforms linux64", f"--platforms {host_platform()}"), tmp_path)


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
