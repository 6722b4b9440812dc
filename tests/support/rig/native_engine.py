"""The engine of the native proxy without its FMU, in a process of its own, under the sanitizers
where gcc is.
"""

from __future__ import annotations

import os
import select
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.kit.build.building import plan_build
from fmus.kit.build.toolchain import find_compiler, host_platform
from fmus.rig_proxy.model import RigProxy

DRIVER = Path(__file__).parents[1] / "c" / "proxy_driver.c"
STRICT = ("-std=c11", "-Wall", "-Wextra", "-Wshadow", "-Wpedantic", "-Werror")
SANITIZED = (
    "-g",
    "-O1",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)
HANG = 20.0  # s; the longest timeout in a test is far below

MEASURED = [o.name for o in RigProxy.layout.outputs if f"{o.name}_age" in RigProxy.layout.names]
LATE = 0.15  # s, that the machine may be late on top of any bound
FAREWELL = 0.2  # s, of the disconnect that follows an error
TIMEOUT, MAX_AGE, DEADLINE, STEP = 0.4, 0.2, 0.05, 0.02
TIMES = {"communication_timeout": TIMEOUT, "max_age": MAX_AGE, "deadline": DEADLINE}
CONNECTED, REFUSED, STALE, LOST = range(4)


def build_driver(folder: Path) -> Path:
    """Compile the engine of a proxy, and what drives it; every warning is an error."""
    planned = plan_build(RigProxy, "native")
    for name, content in planned.sources.items():
        (folder / name).write_bytes(content)
    # one unit, as in the FMU, for its functions are static; the driver does not call all of them
    unit = folder / "unit.c"
    unit.write_text("".join(f'#include "{name}"\n' for name in (*own_sources(), DRIVER)))
    gcc = shutil.which("gcc")
    command = [gcc, *SANITIZED] if gcc else [*find_compiler(host_platform()).command, "-O1"]
    libraries = [f"-l{name}" for name in planned.libraries.get(host_platform(), ())]
    program = folder / "driver"
    command += [*STRICT, f"-I{folder}", "-Wno-unused-function", str(unit), "-o", str(program)]
    subprocess.run([*command, *libraries], check=True, capture_output=True, text=True)
    return program


def own_sources() -> tuple[str, ...]:
    """Names of the C files that are the proxy's own."""
    assert RigProxy.engine is not None
    return RigProxy.engine.sources


@dataclass(frozen=True)
class Answer:
    """The result of a call of the engine; `outputs` by name."""

    ok: bool
    message: str
    seconds: float
    outputs: dict[str, float]

    def __getitem__(self, name: str) -> float:
        return self.outputs[name]


class NativeEngine:
    """One process with one engine. A crash, a finding of a sanitizer or a hang is an
    `AssertionError`.
    """

    def __init__(self, program: Path):
        self._outputs = [o.name for o in RigProxy.layout.outputs]
        environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=1:abort_on_error=0"}
        self._process = subprocess.Popen(
            [program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
        )
        assert self.call("create").ok

    def line(self, *words: Any) -> str:
        """Give a line to the driver and return its answer."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(" ".join(map(str, words)).encode() + b"\n")
            process.stdin.flush()
        except BrokenPipeError:
            self._died()
        ready, _, _ = select.select([process.stdout], [], [], HANG)
        if not ready:
            process.kill()
            raise AssertionError(f"{words[0]} did not return within {HANG:g} s")
        answer = process.stdout.readline()
        return answer.decode().rstrip("\n") if answer.endswith(b"\n") else self._died()

    def _died(self) -> str:
        _, report = self._process.communicate(timeout=HANG)
        raise AssertionError(
            f"the engine ended with {self._process.returncode}\n{report.decode(errors='replace')}"
        )

    def call(self, *words: Any) -> Answer:
        """Call a function of the engine."""
        status, message, seconds, outputs = self.line(*words).split("\t")
        values = map(float.fromhex, outputs.split(" "))
        return Answer(
            status == "ok",
            message,
            float.fromhex(seconds),
            dict(zip(self._outputs, values, strict=True)),
        )

    def set(self, **values: Any) -> None:
        """Give values to inputs and parameters, texts among them."""
        for name, value in values.items():
            assert self.call("text" if isinstance(value, str) else "set", name, value).ok, name

    def initialize(self, time: float = 0.0) -> Answer:
        """Connect."""
        return self.call("initialize", time)

    def advance(self, time: float, step: float) -> Answer:
        """Make a step."""
        return self.call("advance", time, step)

    def read(self) -> Answer:
        """Read the outputs as they are now, as a host does that goes on after an error."""
        return self.call("evaluate", 0.0)

    def close(self) -> None:
        """Free the engine; leaks are found now."""
        if self._process.poll() is None:
            assert self.call("free").seconds < 1.0
        _, report = self._process.communicate(timeout=HANG)
        assert self._process.returncode == 0, report.decode(errors="replace")


def started(engine: NativeEngine, endpoint: str, **values: object) -> None:
    """Initialize an engine, with short times and a current of 0.25 A."""
    engine.set(**TIMES | {"endpoint": endpoint, "current": 0.25} | values)
    answer = engine.initialize()
    assert answer.ok, answer.message


def steps(engine: NativeEngine, first: int, count: int) -> list[Answer]:
    """Make steps up to an error; none may take longer than is promised."""
    answers: list[Answer] = []
    for k in range(first, first + count):
        answers.append(engine.advance(STEP * k, STEP))
        assert answers[-1].seconds < TIMEOUT + LATE + (0.0 if answers[-1].ok else FAREWELL)
        if not answers[-1].ok:
            break
    return answers
