"""Commands ``ppy rig calibrate`` and ``ppy rig opcua``, which are entry points.

No ``from __future__ import annotations``, with which the options in annotations could not be read.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.api.declaration import REQUIRED, Option
from orchestration.api.forms import File, Texts
from orchestration.cli.command import command
from orchestration.cli.commands.options import ServerOptions

_POINTS = 2  # of an adjustment


class CalibrateCommand(ServerOptions, total=False):
    """Options of ``ppy rig calibrate``."""

    file: Annotated[
        Path,
        Option(
            "Calibration that the server has.",
            default=REQUIRED,
            metavar="FILE.toml",
            argument=True,
        ),
    ]
    signal: Annotated[
        str, Option("Measured signal.", default=REQUIRED, metavar="SIGNAL", argument=True)
    ]
    points: Annotated[
        Texts,
        Option(
            "Known value in the file's unit, to be read now, or a point as printed before.",
            flag="--point",
            metavar="KNOWN[=READING]",
        ),
    ]
    duration: Annotated[
        float,
        Option("How long to read at each of them, in s.", default=3.0, least=0.1, most=600.0),
    ]
    uncertainty: Annotated[
        float,
        Option("Standard uncertainty of the known values, in that unit.", default=REQUIRED),
    ]
    source: Annotated[
        str, Option("Reference of the known values.", default=REQUIRED, metavar="TEXT")
    ]
    by: Annotated[str, Option("Whoever adjusts.", default=REQUIRED, metavar="NAME")]


@command(CalibrateCommand)
def calibrate(options: CalibrateCommand) -> None:
    """Adjust gain and offset of a measured signal at two known values, in its calibration file.

    A value that no --point gives is asked for. The old file is kept, with its date. The server must
    have been started with the file, and reads the new one when it is started again.
    """
    from orchestration.plugins.calibration import (
        Point,
        adjust,
        measure,
        served_channel,
        write_adjustment,
    )
    from orchestration.reporting.console import note, out, warn, wrote
    from orchestration.rig import ask, read_endpoint

    path = options["file"]
    remote = read_endpoint(options["endpoint"], options["credentials"], warn)
    status = ask(remote, "status")
    channel = served_channel(path, options["signal"], status)
    points: list[Point] = []
    try:
        for text in _known_values(options["points"], channel.unit):
            point = Point.parse(text)
            if not point.size:
                point = measure(remote, status, channel, point.known, options["duration"])
            out.print(
                f"{point.known:g} {channel.unit}: reads {point.reading:.6g}, standard deviation"
                f" {point.deviation:.3g} of {point.size:g} readings"
            )
            points.append(point)
        new = adjust(channel, points, options["uncertainty"])
        out.print(f"gain {channel.gain:.8g} -> {new.gain:.8g}")
        out.print(f"offset {channel.offset:.8g} -> {new.offset:.8g} {channel.unit}")
        out.print(f"standard uncertainty {new.uncertainty:.3g} {channel.unit}")
        old = write_adjustment(path, channel.name, new, points, options["by"], options["source"])
    except BaseException:
        measured = " ".join(f"--point {point}" for point in points)
        note(f"{path} is as it was; to go on, give the same command {measured}")
        raise
    wrote(path, f"the old one is {old}")
    note("the server goes on with the old one until it is started again")


def _known_values(given: Sequence[str], unit: str) -> Iterator[str]:
    """Yield the points that options give, then known values as they are typed, two in all."""
    if len(given) > _POINTS:
        raise UserError(f"--point: {len(given)} are given; {_POINTS} are wanted")
    yield from given
    for number in range(len(given), _POINTS):
        question = f"known value {number + 1} in {unit}, once it is there"
        if not sys.stdin.isatty():
            raise UserError(f"--point is missing: {question}")
        try:
            yield input(f"{question}: ").strip()
        except EOFError as error:  # the end of what is typed interrupts
            raise KeyboardInterrupt from error


class OpcuaCommand(ServerOptions, total=False):
    """Options of ``ppy rig opcua``."""

    host: Annotated[
        str,
        Option(
            "Address to bind to; beyond 127.0.0.1 the rig cannot be driven.",
            default="127.0.0.1",
            flag="--bind",
            metavar="HOST",
        ),
    ]
    port: Annotated[int, Option("Port of the server of OPC UA.", default=4840, least=1, most=65535)]
    password: Annotated[
        File,
        Option(
            'File with password = "...", with which a user may drive; without it nobody may.',
            metavar="FILE.toml",
        ),
    ]
    lease: Annotated[
        float,
        Option(
            "How long the rig is driven without another write, in s.",
            default=2.0,
            least=0.1,
            most=3600.0,
        ),
    ]


@command(OpcuaCommand)
def opcua(options: OpcuaCommand) -> None:
    """Show a rig in OPC UA, and let it be driven from there.

    Everybody may read and call Stop. With --password a user who knows it may write inputs, within
    all limits of the rig; for that --credentials has to hold a key that may command.
    """
    require("asyncua", "zmq")
    import asyncio
    import logging

    from orchestration.plugins.driver import Driver, read_password
    from orchestration.reporting.console import note, out, warn
    from orchestration.rig import ask, read_endpoint, until_interrupted

    credentials = options["credentials"]
    password = read_password(options["password"], options["host"], warn)
    remote = read_endpoint(options["endpoint"], credentials, warn)
    rig = ask(remote, "status")
    from orchestration.plugins.opcua import Bridge  # which takes seconds to import

    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # it tells every refusal
    driver = Driver(remote, rig, credentials, options["lease"], note)
    bridge = Bridge(remote, rig, driver, password, note)
    address = f"opc.tcp://{options['host']}:{options['port']}/rig"
    ready = f"ready: {address} shows the rig at {remote.requests} (Ctrl-C ends it)"
    with until_interrupted():
        asyncio.run(bridge.run(address, lambda: out.print(ready)))
