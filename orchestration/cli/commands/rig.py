"""``ppy rig``: the server of a rig, its live page, and emergency stop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from fmus.kit import UserError
from fmus.kit.extras import require
from orchestration.cli.command import command
from orchestration.cli.commands.options import (
    AcknowledgeCommand,
    BridgeCommand,
    KeysCommand,
    LogCommand,
    ServeCommand,
    ServerOptions,
    StatusCommand,
    StopCommand,
    TuneCommand,
    WatchCommand,
)
from orchestration.cli.commands.rig_record import archive, record
from orchestration.cli.outputs import write_json
from orchestration.reporting.console import note, out, warn, wrote

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from orchestration.rig import Endpoint
    from orchestration.rig.watch import Observer

rig = typer.Typer(name="rig", add_completion=False, rich_markup_mode="rich")


@rig.command("serve")
@command(ServeCommand)
def serve(options: ServeCommand) -> None:
    """Serve a rig: commands within limits, and measured values with their age.

    It is in a safe state when anything fails, and ends there on Ctrl-C and SIGTERM; SIGUSR1 and
    ppy rig stop are an emergency stop.
    """
    from fmus.rig_proxy import ENDPOINT
    from orchestration.rig import parse_address
    from orchestration.rig.server import WATCHDOG, ServerSettings, default_watchdog, read_options
    from orchestration.rig.server import serve as work

    endpoint = options["endpoint"]
    host = options["host"]
    port = options["port"]
    if endpoint is not None and (host is not None or port is not None):
        raise UserError("--endpoint says all that --bind and --port do; give one of them")
    default = parse_address(endpoint or ENDPOINT)
    watchdog = options["watchdog"]
    if watchdog is None:
        watchdog = WATCHDOG if options["lockstep"] else default_watchdog(note)
    given: dict[str, Any] = {
        **options,
        "options": read_options([*options["backend_options"]]),
        "watchdog": watchdog,
        "host": default[0] if host is None else host,
        "port": default[1] if port is None else port,
    }
    known = ServerSettings.__annotations__
    settings = ServerSettings(**{name: given[name] for name in known if name in given})
    if work(settings):
        raise typer.Exit(1)


@rig.command("watch")
@command(WatchCommand)
def watch(options: WatchCommand) -> None:
    """Show a rig in a browser: signals, limits, ages, state, and a stop button.

    It can command nothing but stop. Of a run beside the rig that permits it (ppy run --tunable) it
    moves parameters, for who has the address that it prints. With --rise a degradation estimator
    observes the actuator, and an alarm stands among the events once its impedance has risen.
    """
    import webbrowser
    from contextlib import nullcontext
    from threading import Thread

    from orchestration.rig import ask, read_endpoint, request_tuning, until_interrupted
    from orchestration.rig.archive import Archive
    from orchestration.rig.watch import (
        Feed,
        Listener,
        PageServer,
        ageing_observed,
        parameters_fed,
    )

    remote = read_endpoint(options["endpoint"], options["credentials"], warn)
    feed = Feed()
    folder = options["archive"]
    if folder is not None:
        require("pyarrow")
        Archive(folder)

    def stop() -> dict[str, object]:
        return ask(remote, "stop", reason="stop button of ppy rig watch")

    run = options["run"]

    def tune(name: str, value: float, slew: float | None) -> Mapping[str, Any]:
        return request_tuning(run, "tune", name=name, value=value, slew=slew)

    rise = options["rise"]
    observed: AbstractContextManager[Observer] = nullcontext(lambda message: None)
    if rise is not None:
        observed = ageing_observed(feed, rise / 100.0, warn)

    with (
        until_interrupted(),
        observed as observe,
        Listener(remote, feed, observe),
        parameters_fed(lambda: request_tuning(run, "parameters"), feed),
        PageServer(options["port"], remote.requests, feed, stop, folder, tune) as page,
    ):
        out.print(f"watching {remote.requests} at {page.address} (Ctrl-C ends it)")
        out.print(f"to move parameters of a run beside it: {page.address}#{page.key}")
        if options["browser"]:
            Thread(target=webbrowser.open, args=(page.address,), daemon=True).start()
        page.serve_forever(poll_interval=0.1)


@rig.command("tune")
@command(TuneCommand)
def tune(options: TuneCommand) -> None:
    """Show or move the tunable parameters of a run in real time (ppy run --tunable)."""
    from orchestration.reporting import plain_table
    from orchestration.rig import request_tuning

    run = options["run"]
    parameters = request_tuning(run, "parameters")
    if options["move"] is not None:
        wanted = _read_move(options["move"], parameters)
        parameters = request_tuning(run, "tune", **wanted)
    table = plain_table(None, "parameter", "value", "moves to", "unit", "least", "largest")
    for name, one in parameters.items():
        limits = ["" if one[end] is None else f"{one[end]:g}" for end in ("min", "max")]
        table.add_row(name, f"{one['value']:g}", f"{one['target']:g}", one["unit"], *limits)
    out.print(table)


def _read_move(text: str, parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Read ``NAME=VALUE[@SLEW]`` into the fields of a request, in the run's units."""
    from fmus.kit.errors import find
    from fmus.kit.units import convert
    from orchestration.fmu.signal import read_quantity

    name, _, values = text.partition("=")
    unit = find(name, parameters, "this run has no parameter to tune")["unit"]
    numbers = []
    for part, own in zip(values.split("@", 1), (unit, f"{unit}/s"), strict=False):
        quantity = read_quantity(part.strip())
        if quantity is None:
            raise UserError(f"{text}: write NAME=VALUE or NAME=VALUE@SLEW, with numbers")
        numbers.append(float(convert(quantity[0], quantity[1] or own, own, text)))
    value, slew = (*numbers, None)[:2]
    return {"name": name, "value": value, "slew": slew}


rig.command("record")(record)
rig.command("archive")(archive)


@rig.command("stop")
@command(StopCommand)
def stop(options: StopCommand) -> None:
    """Stop the rig at once: its safe state, until ppy rig acknowledge.

    Waits until the safe state is confirmed; exit status 1 if it is not.
    """
    from fmus.rig_proxy import SAFE
    from orchestration.rig import operator

    answer = operator.stop(_server(options), options["reason"], options["timeout"])
    _show(answer, options["json"])
    if answer["state"] != SAFE:
        raise typer.Exit(1)


@rig.command("acknowledge")
@command(AcknowledgeCommand)
def acknowledge(options: AcknowledgeCommand) -> None:
    """Let the rig be used again after a safe state; the client has to connect anew.

    Without a name it shows what there is to be acknowledged. The exit status is 1 if the rig cannot
    be used in time.
    """
    from fmus.kit import quoting
    from orchestration.rig import ask, operator

    remote = _server(options)
    latch = options["latch"]
    alarm = options["alarm"]
    shelved = options["shelve"]
    timeout = options["timeout"]
    if shelved is not None and alarm is None:
        raise UserError("--shelve: is of an alarm; give its name with --alarm")
    before = ask(remote, "status", timeout)
    if latch is None and alarm is None:
        _raise_if_unnamed(before)
    for text in filter(None, (before["reason"], before["alarm"])):
        note(f"to be acknowledged: {quoting.line(text)}")
    if alarm is not None and shelved is not None:
        answer = ask(remote, "shelve", timeout, alarm=alarm, time=shelved)
    elif alarm is not None:
        answer = ask(remote, "acknowledge", timeout, latch=alarm)
    else:
        answer = operator.acknowledge(remote, latch or "", timeout)
    _show(answer, options["json"])
    is_open = any(one["name"] == alarm for one in operator.open_alarms(answer))
    if is_open or (alarm is None and answer["latch"]):
        raise typer.Exit(1)


def _raise_if_unnamed(status: Mapping[str, Any]) -> None:
    """Raise UserError with the commands that acknowledge what is open, if there is anything."""
    from fmus.kit import quoting
    from orchestration.rig import operator

    alarms = operator.open_alarms(status)
    open_items = [(one["text"], "--alarm", one["name"]) for one in alarms]
    if status["latch"]:
        reason = f"the rig is latched: {status['reason']}"
        open_items.insert(0, (reason, "--latch", status["latch"]))
    if open_items:
        raise UserError(
            "; ".join(
                f"{quoting.line(text)}; type:"
                f" {quoting.shell(['ppy', 'rig', 'acknowledge', option, name])}"
                for text, option, name in open_items
            )
        )


@rig.command("status")
@command(StatusCommand)
def status(options: StatusCommand) -> None:
    """Show the state of the rig: idle, running or latched, its client, and dropped messages.

    The exit status is 1 if its safe state was not reached.
    """
    from fmus.rig_proxy import NOT_REACHED
    from orchestration.rig import ask

    answer = ask(_server(options), "status", options["timeout"])
    _show(answer, options["json"])
    if answer["state"] == NOT_REACHED:
        raise typer.Exit(1)


def _server(options: ServerOptions) -> Endpoint:
    from orchestration.rig import read_endpoint

    return read_endpoint(options["endpoint"], options["credentials"], warn)


def _show(answer: Any, path: Path | None) -> None:
    """Print an answer of the server, and write it as JSON if wanted."""
    from orchestration.rig import summarise_status

    out.print(summarise_status(answer))
    write_json(path, answer)


@rig.command("log")
@command(LogCommand)
def log(options: LogCommand) -> None:
    """Check that no line of a log of ppy rig serve was changed, put in or taken out later."""
    from orchestration.rig.server import verify

    count = verify(options["files"])
    out.print(f"{count} lines, as they were written")


@rig.command("keys")
@command(KeysCommand)
def keys(options: KeysCommand) -> None:
    """Make CURVE keys: rig-server.toml for the server, rig-client.toml for its client.

    Nothing is overwritten.
    """
    from orchestration.rig import add_client, make_keys

    folder = options["folder"]
    client = options["client"]
    role = options["role"]
    if client is None and role is not None:
        raise UserError("--role: is of one more client; give its name with --client")
    if client is not None:
        wrote(
            add_client(folder, client, role or "command"),
            "keys of the client; let nobody else read it",
        )
        return
    server, first = make_keys(folder)
    wrote(server, "stays with the server")
    wrote(first, "keys of the client; let nobody else read it")


@rig.command("bridge")
@command(BridgeCommand)
def bridge(options: BridgeCommand) -> None:
    """Connect proxies that cannot encrypt to a server with keys.

    Connections are plain on this machine only, and encrypted with CURVE beyond it.
    """
    from orchestration.rig import LOOPBACK, Bridge, read_endpoint, until_interrupted

    endpoint = options["endpoint"]
    port = options["port"]
    remote = read_endpoint(endpoint, options["credentials"], warn)
    local = f"tcp://{LOOPBACK}:{port}"
    if remote.requests == local:
        raise UserError(
            f"--endpoint {endpoint}: this is the bridge itself; --port chooses another port for it"
        )
    with until_interrupted():
        carries = Bridge(remote, port, note, options["no_keys"])
        out.print(f"{local} is carried on to {remote.requests} (Ctrl-C ends it)")
        carries.run()
