"""Damaged files, thousands of them, given to whatever reads files; what is neither read nor refused
is told.

``python -m tests.support.fuzz --seconds 600 --seed 7`` goes on for ten minutes; findings are left
in ``build/fuzz``.
"""

from __future__ import annotations

import argparse
import copy
import json
import random
import re
import resource
import signal
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

LONGEST, MEMORY = 10, 1_000_000_000  # s for a file, and bytes for all of them
# the last two are of SSP 2.0
KINDS = (
    "csv",
    "mat",
    "tdms",
    "parquet",
    "nc",
    "toml",
    "fmu",
    "xml",
    "ssp",
    "ssd",
    "2.0.ssd",
    "ssv",
)
SYSTEMS = ("ssd", "2.0.ssd", "ssv")  # descriptions, and parameters
_ATTRIBUTES = ("startIndices", "endIndices", "size", "sizeConnector", "unit", "kind", "version")
_VALUES = ("", "0", "-1", "1", "2", "1 1", "nan", "1e400", "9" * 30, "two", "../x", "\u0663", "1_0")
_PARAMETERS = "resources/new.ssv"  # of the system of SSP 2.0
_TIME = 0.1 * np.arange(200)
_FAMILIAR = [
    b"0",
    b"-1",
    b"nan",
    b"1e400",
    b"\x00",
    b"\xff",
    b"<",
    b">",
    b"&x;",
    b'"',
    b"[",
    b"]",
    b",",
    b";",
    b"\n",
    b"9" * 400,
    b"=",
    b"..",
    b"/",
    b"\\",
    b"true",
    b"\xef\xbb\xbf",
    b"(" * 500,
    b"<a>" * 300,
]


def originals(folder: Path) -> dict[str, bytes]:
    """Valid files of every kind."""
    import nptdms
    import pandas
    from scipy.io import savemat

    import orchestration as ppy
    from orchestration.experiment import results
    from orchestration.system import library
    from orchestration.system.ssp.writing import write
    from tests.support.hosts import build_one_state_fmu
    from tests.support.system.mixed import mixed

    voltage = np.sin(_TIME)
    made: dict[str, bytes] = {}
    lines = [f"{t:.1f},{v:.6f},{i}" for t, v, i in zip(_TIME, voltage, _TIME > 5.0, strict=True)]
    made["csv"] = ("time [s],voltage [V],current [A]\n" + "\n".join(lines)).encode()
    savemat(
        folder / "r.mat",
        {"time": _TIME, "voltage": voltage, "units": {"time": "s", "voltage": "V"}},
    )
    with nptdms.TdmsWriter(folder / "r.tdms") as writer:
        writer.write_segment(
            [nptdms.ChannelObject("g", n, v) for n, v in (("time", _TIME), ("voltage", voltage))]
        )
    pandas.DataFrame({"time": _TIME, "voltage": voltage}).to_parquet(folder / "r.parquet")
    results.write(ppy.run("fig_3_4", settings={"duration": "1 s"}), folder / "r.nc")
    write(library.system("dma_bench", "native"), folder / "r.ssp")
    build_one_state_fmu(folder).rename(folder / "r.fmu")
    for kind in ("mat", "tdms", "parquet", "nc", "ssp", "fmu"):
        made[kind] = (folder / f"r.{kind}").read_bytes()
    made["toml"] = (Path(__file__).parents[2] / "examples" / "release.toml").read_bytes()
    with zipfile.ZipFile(folder / "r.fmu") as opened:
        made["xml"] = opened.read("modelDescription.xml")
    # with the files that they name beside them
    write(library.system("dma_bench", "native"), folder / "r.ssd")
    write(mixed(folder), folder / "r.2.0.ssd", connectors=True)
    for kind, file in (("ssd", "r.ssd"), ("2.0.ssd", "r.2.0.ssd"), ("ssv", _PARAMETERS)):
        made[kind] = (folder / file).read_bytes()
    return made


def damaged(data: bytes, draw: random.Random) -> bytes:
    """One to four changes: bits, bytes, pieces that go, come twice or move, an end that is missing,
    familiar words.
    """
    changed = bytearray(data)
    for _ in range(draw.randint(1, 4)):
        at, size = draw.randrange(len(changed) + 1), draw.choice([1, 2, 8, 64, 1000])
        act = draw.randrange(7)
        if act == 0 and at < len(changed):
            changed[at] ^= 1 << draw.randrange(8)
        elif act == 1:
            changed[at : at + size] = draw.randbytes(size)
        elif act == 2:
            del changed[at : at + size]
        elif act == 3:
            changed[at:at] = changed[at : at + size]
        elif act == 4:
            del changed[at:]
        elif act == 5:
            changed[at:at] = draw.choice(_FAMILIAR)
        else:
            other = draw.randrange(len(changed) + 1)
            changed[other:other] = changed[at : at + size]
    return bytes(changed)


def tangled(data: bytes, draw: random.Random) -> bytes:
    """One to three changes of XML that leave it well-formed: values, attributes and elements that
    change, come twice, go or get the name of another.
    """
    root = ElementTree.fromstring(data)
    for _ in range(draw.randint(1, 3)):
        nodes = list(root.iter())
        node = draw.choice(nodes)
        other = draw.choice(nodes)
        key = draw.choice([*node.keys(), *other.keys(), *_ATTRIBUTES])
        act = draw.randrange(5)
        if act == 0:
            node.set(key, draw.choice([*other.attrib.values(), *_VALUES]))
        elif act == 1:
            node.attrib.pop(key, None)
        elif act == 2:
            node.append(copy.deepcopy(other))
        elif act == 3 and len(node):
            node.remove(draw.choice(list(node)))
        elif act == 4:
            node.tag = other.tag
    return ElementTree.tostring(root)


def readers() -> dict[str, Callable[[Path], Any]]:
    """Return the reader of each kind of file, the one that a command uses."""
    from orchestration.experiment import results
    from orchestration.fmu.check import check_fmu
    from orchestration.fmu.model import find_model
    from orchestration.records import read_record
    from orchestration.sweeps.file import read_sweep
    from orchestration.system.ssp.reading import read
    from orchestration.system.ssp.writing import write

    def record(path: Path) -> Any:
        return read_record(path, {"voltage": "V", "current": "A"})

    def fmu(path: Path) -> Any:
        return check_fmu(path), find_model(str(path))

    def packed(path: Path) -> Any:
        archive = path.with_suffix(".fmu")
        with zipfile.ZipFile(archive, "w") as opened:
            opened.writestr("modelDescription.xml", path.read_bytes())
        return fmu(archive)

    def system(path: Path) -> None:
        with tempfile.TemporaryDirectory() as folder:
            write(read(path, Path(folder)), Path(folder, "again.ssp"))  # checks it first

    def parameters(path: Path) -> None:
        (path.parent / _PARAMETERS).write_bytes(path.read_bytes())
        system(path.with_name("r.2.0.ssd"))

    records = dict.fromkeys(("csv", "mat", "tdms", "parquet"), record)
    return {
        **records,
        "nc": results.read,
        "fmu": fmu,
        "xml": packed,
        "ssp": system,
        "ssd": system,
        "2.0.ssd": system,
        "ssv": parameters,
        "toml": lambda path: read_sweep(path, lambda line: None),
    }


def tried(read: Callable[[Path], Any], path: Path) -> str:
    """Return the fault of reading a file: none if it is read, or refused in a line."""
    from fmus.kit.errors import UserError

    signal.alarm(LONGEST)
    try:
        read(path)
    except UserError as error:
        return "" if "\n" not in str(error) else f"more than a line: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
    return ""


def peak():
    """Largest resident memory so far, bytes; ``ru_maxrss`` is also that of who started this
    process.
    """
    status = Path("/proc/self/status")
    if status.exists():
        return 1024 * int(re.search(r"VmHWM:\s+(\d+) kB", status.read_text())[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def fuzz(
    seed: int, counts: dict[str, int], seconds: float, left: Path | None = None
) -> dict[str, Any]:
    """Try files until there were so many of each kind, or the time is over."""
    warnings.simplefilter("error")

    def too_long(number: int, frame: Any) -> None:
        raise TimeoutError(f"more than {LONGEST} s")

    signal.signal(signal.SIGALRM, too_long)
    draw, found, done = random.Random(seed), [], dict.fromkeys(counts, 0)
    with tempfile.TemporaryDirectory() as folder:
        made, reading, end = originals(Path(folder)), readers(), time.monotonic() + seconds
        while time.monotonic() < end and any(done[kind] < counts[kind] for kind in counts):
            kind = draw.choice([kind for kind in counts if done[kind] < counts[kind]])
            path = Path(folder) / f"damaged.{kind}"
            damage = draw.choice([damaged, tangled]) if kind in SYSTEMS else damaged
            path.write_bytes(damage(made[kind], draw))
            done[kind] += 1
            if told := tried(reading[kind], path):
                found.append(f"{kind} {done[kind]} of seed {seed}: {told}")
                if left is not None:
                    (left / f"{seed}-{len(found)}.{kind}").write_bytes(path.read_bytes())
    return {"found": found, "done": done, "memory": peak()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--counts", type=json.loads, default=dict.fromkeys(KINDS, 10**9))
    chosen = parser.parse_args()
    left = Path("build/fuzz")
    left.mkdir(parents=True, exist_ok=True)
    told = fuzz(chosen.seed, chosen.counts, chosen.seconds, left)
    print(json.dumps(told))
    sys.exit(bool(told["found"]))


if __name__ == "__main__":
    main()
