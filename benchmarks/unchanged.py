"""Comparison of two versions of the code: diagnoses of the same records, FMUs, experiments.

`draw` writes records of the emulated rig; `keep` diagnoses them with the checkout that it runs in,
builds the FMUs and runs the experiments; `compare` lists the differences between two such results::

    python -m benchmarks.unchanged draw records                 # --seed and --count for others
    python -m benchmarks.unchanged keep records before.json     # in one checkout
    python -m benchmarks.unchanged keep records after.json      # in another
    python -m benchmarks.unchanged compare before.json after.json

Numbers must agree to the last bit. Texts may be worded anew and are counted, but verdicts and
causes must agree. Only the command line of ``ppy`` is used, so that modules may move. Whatever the
file of a result holds already is not made again, so that an interrupted run can be continued.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import zip_longest
from pathlib import Path
from threading import Lock
from typing import Any

Leaf = tuple[str, Any, Any]  # where two results differ, and the two values

_PUBLIC = {
    "creep_polyethylene_cm3": ["--map", "stress=force[N]", "--map", "strain=displacement[m]"],
    "supercapacitor_before_ageing_5mV_per_s": ["--effects", "none"],
    "supercapacitor_after_ageing_5mV_per_s": ["--effects", "none"],
    "supercapacitor_maxwell_2p2A": ["--model", "models/supercapacitor.py:Supercap"],
    "dc_motor_dead_zone": ["--model", "models/dc_motor.py:Motor", "--map", "speed=speed[rpm]"],
}
# for a diagnosis: far more than it takes, so that a busy machine gives the same answer
_TIME = "3600s"
_SHOWN = 12  # differences of a record that are listed


def draw(folder: Path, seed: int, count: int) -> None:
    """Draw records of every hidden variation in turn, clean and unknown ones among them."""
    from demonstrations.emulator.variations import CATALOGUE, UNKNOWN
    from demonstrations.records import draw as drawn
    from demonstrations.records import write

    folder.mkdir(parents=True, exist_ok=True)
    one = [(name,) for name in (*CATALOGUE, *UNKNOWN)]
    hidden = [*one, (), (), ("slack", "double_layer")]
    for k in range(count):
        ids = hidden[k % len(hidden)]
        path = folder / f"{k:02d}-{'+'.join(ids) or 'clean'}.csv"
        colour = 0.9 * (k % 3 == 2)
        for attempt in range(seed + k, seed + k + 100):
            try:
                record = drawn(ids, attempt, noise_colour=colour, duration=300.0 + 60.0 * (k % 4))
            except ValueError:
                continue  # the variation leaves too little to be seen
            write(record, path)
            break
        print(path, flush=True)


def _ppy(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "orchestration.cli", *map(str, arguments)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.getcwd()}
    return subprocess.run(command, capture_output=True, text=True, env=environment)


def _diagnosis(record: Path, options: list[str]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        finished = _ppy("diagnose", record, *options, "--time", _TIME, "--json", result)
        if not result.exists():
            return {"error": finished.stderr}
        figures: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
        return figures


def _experiment(name: str) -> dict[str, str]:
    """Digest of the numbers of an experiment's result."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.csv"
        finished = _ppy("run", name, "--out", result)
        if not result.exists():
            return {"error": finished.stderr}
        rows = result.read_text(encoding="utf-8").splitlines()
        numbers = [row for row in rows if not row.startswith("#")]
        return {"sha256": hashlib.sha256("\n".join(numbers).encode()).hexdigest()}


def _builds() -> dict[str, dict[str, str]]:
    """Digest of every file of every FMU, by build and component."""
    with tempfile.TemporaryDirectory() as folder:
        _ppy("build", "--platforms", "linux64", "--out", folder).check_returncode()
        digests = {}
        for path in sorted(Path(folder).rglob("*.fmu")):
            with zipfile.ZipFile(path) as archive:
                digests[f"{path.parent.name}/{path.name}"] = {
                    name: hashlib.sha256(archive.read(name)).hexdigest()
                    for name in archive.namelist()
                }
    return digests


def _experiments() -> list[str]:
    """Experiments that ship, but for the one that runs in real time."""
    listed = _ppy("run", "--list")
    listed.check_returncode()
    names = [line.split()[0] for line in listed.stdout.splitlines() if line.strip()]
    return sorted(set(names) - {"hil_bench"})


def keep(folder: Path, result: Path, public: Path | None, workers: int) -> None:
    """Diagnose every record, and public ones where they are; build FMUs; run experiments."""
    kept = json.loads(result.read_text(encoding="utf-8")) if result.exists() else {}
    lock = Lock()

    def store(kind: str, name: str, make: Callable[[], Any]) -> None:
        if name in kept.setdefault(kind, {}):
            return
        made = make()
        with lock:
            kept[kind][name] = made
            result.write_text(json.dumps(kept, indent=1), encoding="utf-8")
            print(kind, name, made.get("verdict", made.get("error", "")), flush=True)

    records = [(path, list[str]()) for path in sorted(folder.glob("*.csv"))]
    if public is not None:
        for name, options in _PUBLIC.items():
            placed = [
                str(public / option) if option.startswith("models/") else option
                for option in options
            ]
            records.append((public / f"{name}.csv", placed))
    with ThreadPoolExecutor(workers) as pool:
        jobs = [
            pool.submit(store, "diagnoses", path.stem, partial(_diagnosis, path, options))
            for path, options in records
        ]
    for job in jobs:
        job.result()
    for name in _experiments():
        store("experiments", name, partial(_experiment, name))
    store("fmus", "all", _builds)


def _differences(name: str, a: Any, b: Any) -> Iterator[Leaf]:
    """Leaves at which two results differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            yield from _differences(f"{name}.{key}", a.get(key), b.get(key))
    elif isinstance(a, list) and isinstance(b, list):
        for k, (x, y) in enumerate(zip_longest(a, b)):
            yield from _differences(f"{name}[{k}]", x, y)
    elif a != b:
        yield name, a, b


def _causes(diagnosis: dict[str, Any]) -> list[str]:
    return [cause["effect"] for cause in diagnosis.get("causes", [])]


def _same_diagnosis(record: str, a: dict[str, Any], b: dict[str, Any]) -> bool:
    """Return whether two diagnoses agree in all but the words; list where they do not."""
    leaves = list(_differences("", a, b))
    texts = [leaf for leaf in leaves if isinstance(leaf[1], str) and isinstance(leaf[2], str)]
    others = [leaf for leaf in leaves if leaf not in texts]
    same = not others and a.get("verdict") == b.get("verdict") and _causes(a) == _causes(b)
    if not same:
        print(f"{record}: {a.get('verdict')} {_causes(a)}, now {b.get('verdict')} {_causes(b)}")
    if others:
        print(f"{record}: {len(others)} values differ")
    if texts:
        print(f"{record}: {len(texts)} texts differ")
    for leaf in [*others, *texts][:_SHOWN]:
        print("   ", *leaf)
    return same


def compare(before: Path, after: Path) -> bool:
    """List what differs; return whether diagnoses and experiments are the same."""
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    missing = sorted(old["diagnoses"].keys() ^ new["diagnoses"].keys())
    if missing:
        print(f"only in one of the two: {', '.join(missing)}")
    shared = [name for name in old["diagnoses"] if name in new["diagnoses"]]
    verdicts = [
        _same_diagnosis(name, old["diagnoses"][name], new["diagnoses"][name]) for name in shared
    ]
    print(
        f"{sum(verdicts)} of {len(verdicts)} diagnoses have the same numbers, verdicts and causes"
    )
    results = [
        new.get("experiments", {}).get(name) == digest
        for name, digest in old.get("experiments", {}).items()
    ]
    print(f"{sum(results)} of {len(results)} experiments have the same bits")
    for name, files in old.get("fmus", {}).get("all", {}).items():
        others = new.get("fmus", {}).get("all", {}).get(name, {})
        places = [
            file for file in dict.fromkeys([*files, *others]) if files.get(file) != others.get(file)
        ]
        print(f"{name}: {'identical' if not places else 'differs in ' + ', '.join(places)}")
    return not missing and all(verdicts) and all(results)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.unchanged", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument("--public", type=Path, help="folder of the public records; default none")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("action", choices=("draw", "keep", "compare"))
    parser.add_argument("paths", nargs="+", type=Path)
    chosen = parser.parse_args()
    if chosen.action == "draw":
        draw(*chosen.paths, chosen.seed, chosen.count)
    elif chosen.action == "keep":
        keep(*chosen.paths, chosen.public, chosen.workers)
    elif not compare(*chosen.paths):
        sys.exit(1)


if __name__ == "__main__":
    main()
