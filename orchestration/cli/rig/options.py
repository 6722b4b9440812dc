"""Options of the commands below ``ppy rig``; see `orchestration.cli.options`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypedDict

from fmus.rig_proxy import ENDPOINT, PORT
from orchestration.api.declaration import REQUIRED, Option
from orchestration.api.forms import TEXTS, TIME
from orchestration.cli.options import JsonOption

_ENDPOINT = "tcp://HOST:PORT"
_KEY_FILE = "Key file of a client (ppy rig keys)."


class ServerOptions(TypedDict, total=False):
    """The server that a command speaks to."""

    endpoint: Annotated[str, Option("The rig's server.", default=ENDPOINT, metavar=_ENDPOINT)]
    credentials: Annotated[Path | None, Option(_KEY_FILE, metavar="FILE")]


class WatchCommand(ServerOptions, total=False):
    """Options of ``ppy rig watch``."""

    port: Annotated[
        int,
        Option(
            "Of the page, on this machine; 0 takes a free one.", default=8765, least=0, most=65535
        ),
    ]
    browser: Annotated[
        bool,
        Option("Open the page in a browser.", default=True, flag="--browser/--no-browser"),
    ]


def _timeout(default: float) -> Option:
    return Option("How long to wait for an answer, in s.", default=default, least=0.05, most=60.0)


class TimeoutOption(TypedDict, total=False):
    """The time that an answer may take."""

    timeout: Annotated[float, _timeout(2.0)]


class LongTimeoutOption(TypedDict, total=False):
    """The time that an answer may take for which the rig has to do something."""

    timeout: Annotated[float, _timeout(5.0)]


class ReasonOption(TypedDict, total=False):
    """The reason for a stop."""

    reason: Annotated[str, Option("For the log.", default="ppy rig stop", metavar="TEXT")]


class StopCommand(ServerOptions, TimeoutOption, ReasonOption, JsonOption, total=False):
    """Options of ``ppy rig stop``."""


class AcknowledgeCommand(ServerOptions, LongTimeoutOption, JsonOption, total=False):
    """Options of ``ppy rig acknowledge``."""


class StatusCommand(ServerOptions, TimeoutOption, JsonOption, total=False):
    """Options of ``ppy rig status``."""


class RecordingOptions(TypedDict, total=False):
    """The experiment that drives a rig, and the record of it."""

    stimulus: Annotated[
        str,
        Option(
            "Experiment whose inputs drive the rig, as for ppy run.",
            default=REQUIRED,
            metavar="FILE.toml|NAME",
            complete="experiment",
        ),
    ]
    out: Annotated[Path, Option("Record: .nc, .parquet or .csv.", default=REQUIRED, metavar="FILE")]


class SamplingOptions(TypedDict, total=False):
    """The rows of a record, and what the experiment is changed by."""

    rate: Annotated[
        float | None,
        Option("Rows a second; default those of the experiment.", metavar="HZ"),
    ]
    max_age: Annotated[
        float | None,
        Option("Older values become gaps; default two steps.", metavar="TIME", form=TIME),
    ]
    settings: Annotated[
        Sequence[str],
        Option(
            "Over the file: duration=20s, inputs.force=0.",
            default=(),
            flag="--set",
            metavar="KEY=VALUE",
            form=TEXTS,
        ),
    ]


class RecordRigCommand(RecordingOptions, ServerOptions, SamplingOptions, total=False):
    """Options of ``ppy rig record``."""


class BridgeCommand(TypedDict, total=False):
    """Options of ``ppy rig bridge``."""

    endpoint: Annotated[str, Option("The rig's server.", default=REQUIRED, metavar=_ENDPOINT)]
    credentials: Annotated[Path, Option(_KEY_FILE, default=REQUIRED, metavar="FILE")]
    port: Annotated[
        int,
        Option("On this machine; telemetry is one higher.", default=PORT, least=1, most=65534),
    ]


class KeysCommand(TypedDict, total=False):
    """Options of ``ppy rig keys``."""

    folder: Annotated[
        Path,
        Option(
            "Where the key files go, or are.", default=REQUIRED, metavar="FOLDER", argument=True
        ),
    ]
    client: Annotated[
        str | None,
        Option("Make keys for one more client of the server there.", metavar="NAME"),
    ]


class RigDemoCommand(TypedDict, total=False):
    """Options of ``ppy rig demo``."""

    out: Annotated[
        Path,
        Option("Everything that is made goes here.", default=Path("hil-output"), metavar="FOLDER"),
    ]
    seed: Annotated[int, Option("Which emulated rig, and which effect is hidden in it.", default=1)]


class ServeCommand(TypedDict, total=False):
    """Options of ``ppy rig serve``."""

    backend: Annotated[
        str,
        Option(
            "emulator, replay, nidaqmx, visa, or FILE.py:Class.",
            default="emulator",
            metavar="NAME",
        ),
    ]
    backend_options: Annotated[
        Sequence[str],
        Option(
            "Handed on to the backend; repeatable.",
            default=(),
            flag="--option",
            metavar="KEY=VALUE",
            form=TEXTS,
        ),
    ]
    rate: Annotated[float, Option("Samples per second, up to 1000.", default=30.0)]
    watchdog: Annotated[
        float, Option("How long the rig goes on without a fresh command, in s.", default=0.2)
    ]
    lockstep: Annotated[
        bool, Option("The rig waits for the client; emulator and replay only.", default=False)
    ]
    endpoint: Annotated[
        str | None,
        Option("Where to bind; telemetry is one port higher.", metavar=_ENDPOINT),
    ]
    host: Annotated[
        str | None,
        Option(
            "Address to bind to; beyond 127.0.0.1 with --keys only.", flag="--bind", metavar="HOST"
        ),
    ]
    port: Annotated[int | None, Option("Port, 5570 if not given; 0 is any free one.", metavar="N")]
    keys: Annotated[Path | None, Option("Key file of the server, of ppy rig keys.", metavar="FILE")]
    log: Annotated[Path | None, Option("Add every line to this file, too.", metavar="FILE")]
    priority: Annotated[
        int | None,
        Option(
            "Real-time priority of the device's process, 1 to 99.",
            flag="--device-priority",
            metavar="N",
        ),
    ]
    cpu: Annotated[
        int | None,
        Option("Core that the device's process stays on.", flag="--device-cpu", metavar="N"),
    ]
