"""Build the site of this version beside those of others, with a list to change between them.

``python docs/site/versions.py --out FOLDER --address URL`` writes ``FOLDER/VERSION``, and what is
common to all versions: their list, and a page that leads to the newest. The address is where the
folder will be served; without one it is that of ``python -m http.server``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
START = "docs/index.html"
_LEADS_ON = """<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>ppy-rig</title>
<meta http-equiv="refresh" content="0; url={page}">
<p><a href="{page}">ppy-rig</a></p>
</html>
"""


def build(folder: Path, address: str) -> None:
    """Build this version of the site.

    Raises
    ------
    subprocess.CalledProcessError
        If there is a warning.
    """
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-c", "docs/site"]
    subprocess.run(
        [*command, "-d", str(ROOT / "build" / "doctrees"), ".", str(folder)],
        cwd=ROOT,
        env=os.environ | {"PPY_SITE_ADDRESS": address},
        check=True,
    )


def versions_in(out: Path) -> list[str]:
    """List the versions that are built, the newest first."""
    built = [path.parents[1].name for path in out.glob(f"*/{START}")]
    return sorted(built, key=lambda name: [int(part) for part in name.split(".")], reverse=True)


def list_versions(out: Path, address: str) -> None:
    """Write what is common to all versions."""
    newest, *_ = names = versions_in(out)
    entries = [
        {"version": name, "url": f"{address}/{name}/", "preferred": name == newest}
        for name in names
    ]
    (out / "versions.json").write_text(json.dumps(entries, indent=2) + "\n", encoding="utf-8")
    (out / "index.html").write_text(_LEADS_ON.format(page=f"{newest}/{START}"), encoding="utf-8")


def main() -> None:
    """Build, and list."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "versions")
    parser.add_argument("--address", default="http://127.0.0.1:8000")
    given = parser.parse_args()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    address = given.address.rstrip("/")
    build(given.out.resolve() / project["version"], address)
    list_versions(given.out, address)


if __name__ == "__main__":
    main()
