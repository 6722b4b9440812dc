"""Claims: every page is in the navigation; every command and option is on the page of commands; the
site builds without a warning; in a browser, on a desk and on a phone, nothing is wider than the
page, nothing comes from elsewhere, all can be read and reached by keyboard, and a search finds.
"""

from __future__ import annotations

import itertools
import json
import os
import pickle
import re
import runpy
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from docs.site import versions
from docs.site.commands import describe_commands
from orchestration.cli import app as command_line
from tests.support import site
from tests.support.browser import chromium

pytest.importorskip("sphinx", reason="the tools of the documentation are not installed")
CONFIGURATION = runpy.run_path(str(site.ROOT / "docs" / "site" / "conf.py"))
WIDTHS = (1280, 390)
# pixels by which the page, or the text in it, is wider than the window
OVERFLOW = """Math.max(...[':root', '.bd-article-container'].flatMap(part =>
  [...document.querySelectorAll(part)].map(e => e.scrollWidth - innerWidth)))"""
MOST = 60.0  # s, that a notebook may take


def written() -> set[str]:
    """Pages that there are, by the names that Sphinx gives them."""
    return {
        path.relative_to(site.ROOT).with_suffix("").as_posix()
        for pattern in CONFIGURATION["include_patterns"]
        for path in site.ROOT.glob(pattern)
    }


def test_every_page_has_one_place_in_the_navigation() -> None:
    below = [
        name
        for pages in CONFIGURATION["navigation"].values()
        for page in pages
        for name in sorted(
            path.relative_to(site.ROOT).with_suffix("").as_posix()
            for path in site.ROOT.glob(f"{page}.md")
        )
    ]
    assert sorted([*below, CONFIGURATION["root_doc"]]) == sorted(written())


def test_a_page_links_the_pages_below_it() -> None:
    """Those that Sphinx lists by a pattern need no link."""
    for page, below in CONFIGURATION["navigation"].items():
        text = (site.ROOT / f"{page}.md").read_text(encoding="utf-8")
        folder = (site.ROOT / page).parent
        linked = {
            (folder / target).resolve().relative_to(site.ROOT.resolve()).as_posix()
            for target in re.findall(r"\]\(((?!https?:)[^)#]+)\.md", text)
        }
        assert {name for name in below if "*" not in name} <= linked, page


def test_every_option_of_every_command_is_told() -> None:
    text = describe_commands()
    sections = dict(zip(*[iter(re.split(r"^## (.+)\n", text, flags=re.M)[1:])] * 2, strict=True))
    assert {f"ppy {name}" for name in command_line.names()} <= set(sections)
    for name in command_line.names():
        loaded = command_line.load(name)
        for option in getattr(loaded, "__options__", {}).values():
            for flag in [] if option.argument else option.flags:
                assert f"`{flag}" in sections[f"ppy {name}"], (name, flag)
    assert "`--watchdog " in sections["ppy rig serve"]


def test_the_newest_version_is_preferred(tmp_path: Path) -> None:
    for name in ("0.9.0", "0.10.0", "0.2.1"):
        page = tmp_path / name / versions.START
        page.parent.mkdir(parents=True)
        page.touch()
    versions.list_versions(tmp_path, "http://here")
    entries = json.loads((tmp_path / "versions.json").read_text())
    assert [entry["version"] for entry in entries] == ["0.10.0", "0.9.0", "0.2.1"]
    assert [entry["preferred"] for entry in entries] == [True, False, False]
    assert entries[1]["url"] == "http://here/0.9.0/"
    assert f"url=0.10.0/{versions.START}" in (tmp_path / "index.html").read_text()


def is_busy() -> bool:
    """Tell that others keep the processors from what is timed."""
    return os.getloadavg()[0] > 1.5 * (os.cpu_count() or 1)


# --- built, and in a browser


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("site") / "html"
    done = site.build(out, "-W", "--keep-going")
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def tab(browser, tmp_path_factory):
    if os.name == "nt":
        pytest.skip("the browser is spoken to over pipes as POSIX has them")
    with chromium(browser, tmp_path_factory.mktemp("profile")) as tab:
        yield tab


@pytest.fixture(scope="module")
def address(built):
    with site.served(built) as address:
        yield address


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_notebooks_take_less_than_a_minute_and_show_pictures(built: Path) -> None:
    with (built / ".doctrees" / "environment.pickle").open("rb") as file:
        environment = pickle.load(file)
    pages = CONFIGURATION["navigation"]["docs/gallery/index"]
    for page in pages:
        done = environment.nb_metadata[page]["exec_data"]
        assert done["succeeded"], page
        assert done["runtime"] < MOST or is_busy(), page
        executed = json.loads((built.parent / "jupyter_execute" / f"{page}.ipynb").read_text())
        outputs = [output for cell in executed["cells"] for output in cell.get("outputs", ())]
        assert any("image/png" in output.get("data", ()) for output in outputs), page
        assert all(output.get("name") != "stderr" for output in outputs), page
    gallery = (built / "docs" / "gallery" / "index.html").read_text(encoding="utf-8")
    assert gallery.count("<li><img") == len(pages)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_page_stands_in_a_browser(tab, built: Path, address: str) -> None:
    wrong: dict[tuple[str, int], object] = {}
    for page, width in itertools.product(sorted(written() | {"search"}), WIDTHS):
        tab.open(f"{address}/{page}.html", width)
        overflow = tab.run(OVERFLOW)
        found = SimpleNamespace(
            overflow=max(overflow, 0),
            complaints=[*tab.complaints],
            elsewhere=[url for url in tab.requests if not url.startswith((address, "data:"))],
            refused=[entry for entry in tab.statuses() if entry[1] >= 400],
            low_contrast=tab.run(site.LOW_CONTRAST),
            unreachable=tab.run(site.UNREACHABLE),
        )
        if any(vars(found).values()):
            wrong[page, width] = {name: list_of for name, list_of in vars(found).items() if list_of}
    assert wrong == {}


@pytest.mark.slow
def test_dark_is_as_readable(tab, built: Path, address: str) -> None:
    """Of a reader whose system is dark."""
    for scheme in ("dark", "light"):
        wanted = [{"name": "prefers-color-scheme", "value": scheme}]
        tab.call("Emulation.setEmulatedMedia", features=wanted)
        for page in ("docs/index", "docs/how-to/diagnose", "docs/gallery/motor"):
            tab.open(f"{address}/{page}.html", WIDTHS[0])
            assert tab.run("document.documentElement.dataset.theme") == scheme
            assert tab.run(site.LOW_CONTRAST) == [], (page, scheme)


@pytest.mark.slow
def test_the_keyboard_goes_from_the_top_to_a_page(tab, built: Path, address: str) -> None:
    """The first stop skips the navigation, a link shows its focus, and Enter follows it."""
    tab.open(f"{address}/docs/index.html", WIDTHS[0])
    stops = []
    for _ in range(40):
        tab.press("Tab")
        stops.append(tab.run("document.activeElement.textContent.trim()"))
        if stops[-1] == "Tutorial":
            break
    assert stops[0].lower().startswith("skip")
    assert stops[-1] == "Tutorial"
    assert (
        tab.run("getComputedStyle(document.activeElement).outlineStyle") != "none"
        or tab.run("getComputedStyle(document.activeElement).boxShadow") != "none"
    )
    key = {"key": "Enter", "text": "\r", "windowsVirtualKeyCode": 13}
    tab.follow("Input.dispatchKeyEvent", type="keyDown", **key)
    assert tab.run("location.pathname").endswith("/docs/tutorial.html")


@pytest.mark.slow
def test_a_search_finds_a_page_and_an_option(tab, built: Path, address: str) -> None:
    for words, page in (
        ("algebraic loop", "docs/reference/master.html"),
        ("watchdog", "commands.html"),
    ):
        tab.open(f"{address}/search.html?q={words.replace(' ', '+')}", WIDTHS[0])
        tab.run("new Promise(done => setTimeout(done, 1500))")
        hits = tab.run("[...document.querySelectorAll('#search-results li a')].map(a => a.href)")
        assert any(page in hit for hit in hits), hits
        assert tab.complaints == []


@pytest.mark.slow
def test_a_reader_changes_to_the_same_page_of_another_version(tab, tmp_path: Path) -> None:
    """Two pages are enough of a site, and a copy is enough of another version."""
    few = "include_patterns=docs/index.md,docs/tutorial.md"
    with site.served(tmp_path) as address:
        newest = tmp_path / CONFIGURATION["release"]
        site.build(newest, "-D", few, address=address)
        shutil.copytree(newest, tmp_path / "0.0.9")
        versions.list_versions(tmp_path, address)
        tab.open(f"{address}/{newest.name}/docs/tutorial.html", WIDTHS[0])
        tab.run("new Promise(done => setTimeout(done, 1000))")
        links = tab.run(
            "[...document.querySelectorAll('.version-switcher__menu a')].map(a => a.href)"
        )
        expected = [f"{address}/{name}/docs/tutorial.html" for name in (newest.name, "0.0.9")]
        assert links[: len(expected)] == expected
        assert tab.complaints == []
