"""A real Chromium without a window, spoken to in its own DevTools protocol over a pipe."""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_PATIENCE = 60.0  # seconds for one answer
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    # whatever is asked of the network fails, and so shows
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


def measured(browser, folder, contents, width, picture=None):
    """Width of the contents, width of the view, pictures shown; and the complaints of the page.

    The page is asked from outside, because its own content policy may forbid scripts.

    Parameters
    ----------
    picture : Path, optional
        Where to draw what is seen.
    """
    page = folder / "measured.html"
    page.write_text(contents, encoding="utf-8")
    with chromium(browser, folder / f"profile-{width}") as tab:
        tab.open(page, width, height=1600)
        found = tab.run(
            "[document.documentElement.scrollWidth, document.documentElement.clientWidth,"
            " [...document.images].filter(image => image.naturalWidth > 0).length]"
        )
        if picture is not None:
            tab.screenshot(picture, whole=False)
        return tuple(found), list(tab.complaints)


class Pipe:
    """The two ends of a browser's pipe, and the tabs that are spoken to by them."""

    def __init__(self, read: int, write: int):
        self._read, self._write, self._buffer, self._count = read, write, b"", 0
        self.tabs: dict[str, Tab] = {}

    def call(self, method: str, session: str | None = None, **parameters: Any) -> Any:
        """Ask for something and wait for the answer; what tabs say meanwhile is noted."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        message |= {"sessionId": session} if session else {}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._count:
            self._note(answer)
        assert "error" not in answer, answer
        return answer["result"]

    def listen(self) -> None:
        """Wait for something that a tab says."""
        self._note(self._next())

    def _note(self, event: dict[str, Any]) -> None:
        tab = self.tabs.get(event.get("sessionId", ""))
        if tab is not None:
            tab.note(event)

    def _next(self) -> dict[str, Any]:
        until = time.monotonic() + _PATIENCE
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(until - time.monotonic(), 0.0))
            assert ready, "the browser does not answer"
            more = os.read(self._read, 1 << 20)
            assert more, "the browser has gone"
            self._buffer += more
        first, _, self._buffer = self._buffer.partition(b"\0")
        found: dict[str, Any] = json.loads(first)
        return found


class Tab:
    """A page, and all that it said, asked for and was answered with."""

    def __init__(self, pipe: Pipe):
        self._pipe = pipe
        self._target = pipe.call("Target.createTarget", url="about:blank")["targetId"]
        attached = pipe.call("Target.attachToTarget", targetId=self._target, flatten=True)
        self._session = attached["sessionId"]
        pipe.tabs[self._session] = self
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._urls: dict[str, str] = {}
        self._statuses: dict[str, int] = {}
        self._loaded = 0
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """Ask the page for something and wait for the answer."""
        return self._pipe.call(method, self._session, **parameters)

    def statuses(self) -> list[tuple[str, int]]:
        """Addresses with how they were answered."""
        found = self._statuses.items()  # which a browser may tell before the request itself
        return [(self._urls[number], status) for number, status in found if number in self._urls]

    def another(self) -> Tab:
        """Open one more tab of the same browser."""
        return Tab(self._pipe)

    def close(self) -> None:
        """Close the tab, as a user does."""
        del self._pipe.tabs[self._session]
        self._pipe.call("Target.closeTarget", targetId=self._target)

    def open(self, page: Path | str, width: int, height: int = 900) -> None:
        """Load a file or an address in a window of this size and wait until it stands."""
        mobile = width < 600
        self.call("Page.bringToFront")  # nothing is drawn in a tab that is hidden
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=mobile,
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=mobile)
        self._go(
            "about:blank"
        )  # what the page before still asks for is no complaint about this one
        for noted in (self.requests, self.complaints, self._urls, self._statuses):
            noted.clear()
        self._go(page if isinstance(page, str) else page.absolute().as_uri())
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def _go(self, address: str) -> None:
        self.follow("Page.navigate", url=address)

    def follow(self, method: str, **parameters: Any) -> None:
        """Do what leads to another page, and wait until that is loaded."""
        before = self._loaded
        self.call(method, **parameters)
        while self._loaded == before:
            self._pipe.listen()

    def press(self, key: str) -> None:
        """Press a key that writes nothing, and let it go."""
        code = {"Tab": 9}[key]
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)

    def run(self, script: str) -> Any:
        """Value of an expression in the page; a promise is waited for."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def screenshot(self, file: Path, whole: bool = True) -> None:
        """Draw what is seen, or the whole page."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]
        file.write_bytes(base64.b64decode(data))

    def note(self, event: dict[str, Any]) -> None:
        """Note what the browser says of the page."""
        method, about = event.get("method"), event.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])
            self._urls[about["requestId"]] = about["request"]["url"]
        elif method == "Network.responseReceivedExtraInfo":  # also where the page does not get it
            self._statuses[about["requestId"]] = about["statusCode"]
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(str(about["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and about["type"] in (
            "error",
            "warning",
            "assert",
        ):
            self.complaints.append(str(about["args"]))
        elif method == "Log.entryAdded" and about["entry"]["level"] in ("error", "warning"):
            self.complaints.append(about["entry"]["text"])
        elif method == "Page.loadEventFired":
            self._loaded += 1


@contextmanager
def chromium(program: str, profile: Path) -> Iterator[Tab]:
    """Start a browser in a fresh profile, and end it afterwards."""
    import fcntl  # which Windows does not have

    ours, theirs = os.pipe(), os.pipe()
    # away from 3 and 4, where the browser looks for its two ends
    read, write = (fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (ours[0], theirs[1]))
    for fd in (ours[0], theirs[1]):
        os.close(fd)
    command = [
        "bash",
        "-c",
        f'exec "$@" 3<&{read} 4>&{write}',
        "bash",
        program,
        *_FLAGS,
        "--remote-debugging-pipe",
        f"--user-data-dir={profile}",
    ]
    process = subprocess.Popen(
        command, pass_fds=(read, write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    os.close(read)
    os.close(write)
    try:
        pipe = Pipe(theirs[0], ours[1])
        yield Tab(pipe)
        pipe.call("Browser.close")
        process.wait(_PATIENCE)
    finally:
        process.kill()
        process.wait()
        os.close(theirs[0])
        os.close(ours[1])
