"""Whether two versions of the code say the same of the same records, and build the same FMUs.

`draw` writes records of the emulated rig, `keep` what the checkout that it runs in says of them and the hashes of the
FMUs that it builds, `compare` tells what differs between two such results::

    python -m benchmarks.unchanged draw records
    python -m benchmarks.unchanged keep records before.json     # in one checkout
    python -m benchmarks.unchanged keep records after.json      # in another
    python -m benchmarks.unchanged compare before.json after.json

Only the command line of ``ppy`` is used to diagnose and to build, so that no module has to lie where it did.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
import zipfile
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Any

RECORDS = 40
_PUBLIC = {
    "creep_polyethylene_cm3": ["--map", "stress=force[N]", "--map", "strain=displacement[m]"],
    "supercapacitor_before_ageing_5mV_per_s": ["--effects", "none"],
    "supercapacitor_after_ageing_5mV_per_s": ["--effects", "none"],
    "supercapacitor_maxwell_2p2A": ["--model", "models/supercapacitor.py:Supercap"],
    "dc_motor_dead_zone": ["--model", "models/dc_motor.py:Motor", "--map", "speed=speed[rpm]"],
}


def draw(folder: Path) -> None:
    """Draw records of every hidden variation in turn, clean and unknown ones among them."""
    try:
        from orchestration.rig.emulator.records import draw as drawn
        from orchestration.rig.emulator.records import write
        from orchestration.rig.emulator.variations import CATALOGUE, UNKNOWN
    except ImportError:  # the checkout may be one from before the emulator had a folder
        from orchestration.rig.records import draw as drawn  # type: ignore[no-redef, import-not-found]
        from orchestration.rig.records import write  # type: ignore[no-redef]
        from orchestration.rig.variations import CATALOGUE, UNKNOWN  # type: ignore[no-redef, import-not-found]

    folder.mkdir(parents=True, exist_ok=True)
    hidden = [
        *((name,) for name in CATALOGUE),
        *((name,) for name in UNKNOWN),
        (),
        (),
        ("slack", "double_layer"),
    ]
    for k in range(RECORDS):
        ids = hidden[k % len(hidden)]
        options = {"noise_colour": 0.9 * (k % 3 == 2), "duration": 300.0 + 60.0 * (k % 4)}
        path = folder / f"{k:02d}-{'+'.join(ids) or 'clean'}.csv"
        for seed in range(7000 + k, 7100 + k):
            try:
                write(drawn(ids, seed, **options), path)
                break
            except ValueError:  # this one leaves too little: another
                continue
        print(path, flush=True)


def _said(record: Path, options: list[str]) -> tuple[str, dict[str, Any]]:
    """Diagnose in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [
            sys.executable,
            "-m",
            "orchestration.cli",
            "diagnose",
            str(record),
            *options,
            "--json",
            str(result),
        ]
        done = subprocess.run(
            command, capture_output=True, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"}
        )
        figures = (
            json.loads(result.read_text(encoding="utf-8"))
            if result.exists()
            else {"error": done.stderr}
        )
    print(record.stem, figures.get("verdict", figures), flush=True)
    return record.stem, figures


def _built() -> dict[str, dict[str, str]]:
    """Hash every file of every FMU, by build and component."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "orchestration.cli",
            "build",
            "--platforms",
            "linux64",
            "--out",
            folder,
        ]
        subprocess.run(command, check=True, capture_output=True)
        hashes = {}
        for path in sorted(Path(folder).rglob("*.fmu")):
            with zipfile.ZipFile(path) as archive:
                hashes[f"{path.parent.name}/{path.name}"] = {
                    name: hashlib.sha256(archive.read(name)).hexdigest()
                    for name in archive.namelist()
                }
    return hashes


def keep(folder: Path, result: Path, public: Path | None, workers: int) -> None:
    """Diagnose every record, and public ones where they are."""
    todo = [(path, []) for path in sorted(folder.glob("*.csv"))]
    if public is not None:
        for name, options in _PUBLIC.items():
            options = [str(public / o) if o.startswith("models/") else o for o in options]
            todo.append((public / f"{name}.csv", options))
    with ThreadPoolExecutor(workers) as pool:
        figures = dict(pool.map(lambda job: _said(*job), todo))
    result.write_text(
        json.dumps({"diagnoses": figures, "fmus": _built()}, indent=1), encoding="utf-8"
    )


def _differences(name: str, a: Any, b: Any, places: list[tuple[str, Any, Any]]) -> None:
    """List the leaves at which two results differ; numbers that are equal to 1e-9 do not."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            _differences(f"{name}.{key}", a.get(key), b.get(key), places)
    elif isinstance(a, list) and isinstance(b, list):
        for k, (x, y) in enumerate(zip_longest(a, b)):
            _differences(f"{name}[{k}]", x, y, places)
    elif isinstance(a, float | int) and isinstance(b, float | int) and not isinstance(a, bool):
        if not math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-300):
            places.append((name, a, b))
    elif a != b:
        places.append((name, a, b))


def _shift(before: dict[str, Any], after: dict[str, Any]) -> float:
    """Return the largest change of a parameter, in standard errors (a 95 % interval has 3.92 of them)."""
    largest = 0.0
    for name, old in before.get("parameters", {}).items():
        new = after.get("parameters", {}).get(name)
        if new and None not in old["ci95"] and old["ci95"][1] > old["ci95"][0]:
            largest = max(
                largest, abs(new["value"] - old["value"]) * 3.92 / (old["ci95"][1] - old["ci95"][0])
            )
    return largest


def compare(before: Path, after: Path) -> bool:
    """Tell what differs; return whether verdicts and causes are the same everywhere."""
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    same = True
    for record, a in old["diagnoses"].items():
        b = new["diagnoses"].get(record, {})
        names = [[c["effect"] for c in x.get("causes", [])] for x in (a, b)]
        if a.get("verdict") != b.get("verdict") or names[0] != names[1]:
            same = False
            print(
                f"{record}: {a.get('verdict')} {names[0]} has become {b.get('verdict')} {names[1]}"
            )
        places: list[tuple[str, Any, Any]] = []
        _differences("", a, b, places)
        if places:
            print(
                f"{record}: {len(places)} places differ, a parameter by {_shift(a, b):.2g} standard errors at most"
            )
            for place in places[:12]:
                print("   ", *place)
    print(
        f"{len(old['diagnoses'])} records: verdicts and causes are {'the same' if same else 'NOT the same'}"
    )
    for name, files in old["fmus"].items():
        others = new["fmus"].get(name, {})
        places = [
            file for file in dict.fromkeys([*files, *others]) if files.get(file) != others.get(file)
        ]
        print(f"{name}: {'identical' if not places else 'differs in ' + ', '.join(places)}")
    return same


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.unchanged", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument("--public", type=Path, help="folder of the public records; default none")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("what", choices=("draw", "keep", "compare"))
    parser.add_argument("paths", nargs="+", type=Path)
    chosen = parser.parse_args()
    if chosen.what == "draw":
        draw(*chosen.paths)
    elif chosen.what == "keep":
        keep(*chosen.paths, chosen.public, chosen.workers)
    elif not compare(*chosen.paths):
        sys.exit(1)


if __name__ == "__main__":
    main()
