"""Options of each command: those of Python, those that commands share, and its own.

No ``from __future__ import annotations``: see `orchestration.api.options`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypedDict

from fmus.rig_proxy import ENDPOINT, PORT
from orchestration.api.declaration import REQUIRED, Option
from orchestration.api.forms import (
    ASSIGNMENTS,
    NAMES,
    SIZE,
    File,
    Names,
    Number,
    Percent,
    Seconds,
    Texts,
    names_among,
    some_of,
)
from orchestration.api.options import (
    AgeOptions,
    AssumptionOptions,
    BandOptions,
    DesignOptions,
    DiagnoseOptions,
    EachOption,
    FittedOption,
    GridOptions,
    InputsOption,
    LawsOptions,
    LineariseOptions,
    MappingOption,
    OptimiseOptions,
    OutputsOption,
    ReadingOptions,
    ResponseOptions,
    SamplePeriodOption,
    SettingsOption,
    StudyOptions,
    SweepDesignOptions,
    SweepEngineOptions,
    ToleranceOption,
    UnitsOption,
    WorkersOption,
)
from orchestration.cli.options import (
    TUNING_PORT,
    IsolateOption,
    IsolationOptions,
    JsonOption,
    JunitOption,
    LaidOverOption,
    ModelArgument,
    ModelOption,
    PlatformsOption,
    PlotOption,
    PresetOption,
    RealTimeOptions,
    RecordArgument,
    RecordsArgument,
    RunnableArgument,
    RunnableOption,
    RuntimeOption,
    Tolerances,
    TuningOptions,
)

_Models = Annotated[
    list[str] | None,
    Option(
        "Components, path/to/file.py:Class, or FMUs built from these; default all components.",
        metavar="[MODEL]...",
        complete="component",
        argument=True,
    ),
]
_NoKeys = Annotated[bool, "Everybody on this machine may drive the rig, without a key."]

# --- components and FMUs -------------------------------------------------------------------------


class ReportOption(TypedDict):
    """The page of a result."""

    report: Annotated[File, "Page (.html) with all of it, to look at and pass on."]


class InfoCommand(LaidOverOption, ReadingOptions, JsonOption, ReportOption):
    """Options of ``ppy info``."""

    model: Annotated[
        str,
        Option(
            "A component (see ppy list), path/to/file.py:Class, an .fmu file; a record; or a"
            " diagnosis (.json), which is shown as it was.",
            metavar="MODEL|RECORD|DIAGNOSIS",
            complete="component",
            argument=True,
        ),
    ]
    of_model: Annotated[
        str | None,
        Option(
            "Model that a record is for: tells the --map that it needs.",
            flag="--model",
            metavar="MODEL",
            complete="component",
        ),
    ]


class CheckCommand(JsonOption, JunitOption):
    """Options of ``ppy check``."""

    fmus: Annotated[
        list[Path], Option("FMU files, ours or anybody's.", metavar="FMU...", argument=True)
    ]
    accept: Annotated[File, "Findings that do not count, each with its reason (.toml)."]
    fail_on: Annotated[
        str,
        Option(
            "Exit status 1 from such a finding on: error (default), warning or note.",
            default="error",
            metavar="SEVERITY",
            choices=("error", "warning", "note"),
        ),
    ]


class BuildCommand(LaidOverOption, SettingsOption, PlatformsOption):
    """Options of ``ppy build``."""

    names: _Models
    runtime: Annotated[
        str,
        Option(
            "python, native or both; pythonfmu: a stock archive of that.",
            default="both",
            choices=("python", "native", "both", "pythonfmu"),
        ),
    ]
    fmi: Annotated[
        int, Option("Version of FMI, 2 or 3; 3 in OUT/fmi3 and OUT/fmi3-python.", default=2)
    ]
    clocks: Annotated[bool, "Declare when states are sampled, as clocks of FMI 3.0."]
    out: Annotated[Path, Option("Folder that gets RUNTIME/NAME.fmu.", default=Path("fmu"))]


class ExportModelicaCommand(LaidOverOption, SettingsOption):
    """Options of ``ppy export modelica``."""

    names: _Models
    out: Annotated[Path, Option("Folder that gets the package.", default=Path("modelica"))]
    fmus: Annotated[bool, "Also models that FMUs for this machine compute."]
    fitted: Annotated[File, "Parameters from a fit (ppy identify --json), as defaults."]


class NewCommand(ModelOption):
    """Options of ``ppy new``."""

    kind: Annotated[
        str,
        Option(
            "component, effect or backend.",
            metavar="KIND",
            argument=True,
            choices=("component", "effect", "backend"),
        ),
    ]
    name: Annotated[
        str, Option("In small letters, such as dry_friction.", metavar="NAME", argument=True)
    ]
    law: Annotated[
        str, Option("Law of the model that an effect changes; any other lists them.", default="")
    ]
    out: Annotated[Path, Option("Folder that gets the files.", default=Path("."))]


# --- simulations ---------------------------------------------------------------------------------


class InputFileOption(TypedDict):
    """The record that drives a simulation."""

    input_file: Annotated[
        File, Option("Record with the inputs, held between samples.", flag="--input")
    ]


class SimulateCommand(
    RunnableArgument,
    InputFileOption,
    LaidOverOption,
    SettingsOption,
    PresetOption,
    MappingOption,
    GridOptions,
    OutputsOption,
    ToleranceOption,
    PlotOption,
    RuntimeOption,
    IsolationOptions,
):
    """Options of ``ppy simulate``."""

    log_calls: Annotated[File, "Each call of the FMU, with arguments and status, a line each."]
    state_in: Annotated[File, "Go on from the state that --state-out wrote, at its time."]
    state_out: Annotated[File, "State of the FMU at the last point."]
    out: Annotated[File, "Inputs and outputs, with units: .csv, .nc or .parquet."]


class ExperimentSettingsOption(TypedDict):
    """Changes of the experiment that is run."""

    settings: Annotated[
        Sequence[str],
        ASSIGNMENTS,
        Option(
            "Over the file: duration=20s, R1=610mohm, inputs.current.value=1, or parameters of a"
            " file: specimen.toml, MEMBER@specimen.toml.",
            flag="--set",
            alias="--params",
            metavar="KEY=VALUE",
        ),
    ]


class RunCommand(
    ExperimentSettingsOption,
    ReportOption,
    JsonOption,
    JunitOption,
    RuntimeOption,
    RealTimeOptions,
    TuningOptions,
    IsolationOptions,
):
    """Options of ``ppy run``."""

    tube: Annotated[
        Tolerances,
        Option(
            "By how much a result made again may differ, as 'voltage=1mV, omega=0.5%' of its range;"
            " default not at all.",
            flag="--tolerance",
        ),
    ]
    show_list: Annotated[bool, Option("List the experiments that ship.", flag="--list")]
    experiment: Annotated[
        str | None,
        Option(
            "One of --list, a file, a system, or a result to make again.",
            metavar="NAME|FILE.toml|SYSTEM.ssp|RESULT",
            complete="experiment",
            argument=True,
        ),
    ]
    out: Annotated[File, "Result: .nc, .parquet (both can be run again) or .csv."]
    plot: Annotated[File, "Picture (.png, .svg, .pdf) or page (.html)."]


class RangesOption(TypedDict):
    """Values over which parameters vary."""

    over: Annotated[
        Texts,
        Option(
            "Range of a parameter, or of an input that is held: R1=0.3..0.7:41,"
            " C=1e-3..1e-1:7 log, k1=6.3N/mm, 9N/mm; R1=0.3..0.7 for a design that chooses the"
            " values. Repeatable.",
            metavar="NAME=FROM..TO:COUNT",
        ),
    ]


class DatasetOption(TypedDict):
    """The result of a sweep as a file."""

    out: Annotated[
        File,
        "Result with units: .nc, or .zarr for more than fits into memory. Interrupted, the same"
        " command goes on.",
    ]


class SweepCommand(
    RunnableArgument,
    RangesOption,
    SweepDesignOptions,
    LaidOverOption,
    SettingsOption,
    PresetOption,
    GridOptions,
    ToleranceOption,
    SweepEngineOptions,
    DatasetOption,
    PlotOption,
    ReportOption,
    RuntimeOption,
    IsolationOptions,
):
    """Options of ``ppy sweep``."""

    fitted: Annotated[
        File,
        "Draw parameters from a fit (ppy identify --json): --samples of them, and bands of the"
        " outputs.",
    ]


# --- linear models -------------------------------------------------------------------------------


class LineariseCommand(
    RunnableArgument,
    LaidOverOption,
    LineariseOptions,
    PresetOption,
    InputFileOption,
    MappingOption,
    RangesOption,
    BandOptions,
    JsonOption,
    PlotOption,
):
    """Options of ``ppy linearise``."""

    mat: Annotated[File, "A, B, C, D with names and units, for MATLAB (.mat)."]


class DesignCommand(
    RunnableArgument,
    LaidOverOption,
    DesignOptions,
    RangesOption,
    BandOptions,
    JsonOption,
    PlotOption,
):
    """Options of ``ppy design``."""

    out: Annotated[
        File,
        Option(
            "Folder for controller.py, controller.fmu, loop.ssp and step.toml, which runs it.",
            metavar="FOLDER",
        ),
    ]


# --- optimisation --------------------------------------------------------------------------------


class OptimiseCommand(
    ModelArgument,
    OptimiseOptions,
    LaidOverOption,
    SettingsOption,
    PresetOption,
    GridOptions,
    JsonOption,
    PlotOption,
):
    """Options of ``ppy optimise``."""

    over: Annotated[
        list[str],
        Option(
            "Range of a parameter that is searched: r_po=30..45mm, C=1e-3..1e-1 log. Repeatable.",
            default=REQUIRED,
            metavar="NAME=FROM..TO",
        ),
    ]


# --- a model and a record ------------------------------------------------------------------------


class MeasuringOptions(
    RunnableOption, LaidOverOption, MappingOption, SettingsOption, PresetOption, ToleranceOption
):
    """A model, and how a record that it is compared with is read."""


class MeasuredOptions(RecordArgument, MeasuringOptions):
    """A model, and the record that it is compared with."""


class ReferenceOptions(TypedDict):
    """A result that another one is compared with, and by how much it may differ."""

    reference: Annotated[
        File,
        Option(
            "Compare two files: this is right, RECORD a result. Not with a model.", argument=True
        ),
    ]
    tube: Annotated[
        Tolerances,
        "With a REFERENCE: 20ms,1% of its range around it; v=1mV for one signal; default the"
        " last bit.",
    ]


class CompareCommand(
    MeasuredOptions,
    ReferenceOptions,
    FittedOption,
    JsonOption,
    JunitOption,
    PlotOption,
    ReportOption,
    RuntimeOption,
    IsolateOption,
):
    """Options of ``ppy compare``."""

    require: Annotated[
        Percent,
        "Exit status 1 unless every output fits that well, such as 95%; after --fit if given.",
    ]
    out: Annotated[File, "The figures as JSON (.json)."]


class IdentifyCommand(
    RecordsArgument,
    MeasuringOptions,
    AssumptionOptions,
    WorkersOption,
    JsonOption,
    PlotOption,
    ReportOption,
    IsolateOption,
):
    """Options of ``ppy identify``."""

    profile: Annotated[
        list[str] | None,
        NAMES,
        Option("Of the fitted ones: an interval by the likelihood itself.", metavar="PARAMETERS"),
    ]
    profile_plot: Annotated[File, "The profiles as a picture (.png, .svg or .pdf)."]
    posterior: Annotated[
        Number,
        Option(
            "Independent samples of the posterior, e.g. 1000; needs the extra sampling.", least=1
        ),
    ]
    corner: Annotated[File, "The posterior of all pairs as a picture (.png, .svg or .pdf)."]
    ssv: Annotated[File, "The values as a parameter set (.ssv), for any system."]
    fit: Annotated[
        list[str],
        some_of("name the parameters, e.g. R1,R2,C"),
        Option("Parameters, e.g. R1,R2,C.", default=REQUIRED),
    ]


class AgeCommand(
    RunnableOption, MappingOption, SettingsOption, AgeOptions, JsonOption, PlotOption, ReportOption
):
    """Options of ``ppy age``."""

    records: Annotated[
        list[Path],
        Option(
            "Measured records in the order of use; a folder stands for its files, by name.",
            metavar="RECORD|FOLDER...",
            argument=True,
        ),
    ]
    out: Annotated[File, "Windows with their intervals (.csv)."]


class FrequencyCommand(
    RecordArgument,
    LaidOverOption,
    MappingOption,
    SettingsOption,
    PresetOption,
    UnitsOption,
    ResponseOptions,
    JsonOption,
    PlotOption,
    IsolateOption,
):
    """Options of ``ppy frequency``."""

    out: Annotated[File, "Responses with their intervals (.csv)."]
    model: Annotated[
        str | None,
        Option(
            "Shown with the record: a component (see ppy list), path/to/file.py:Class, an .fmu"
            " file, or a system: its name or .ssp file.",
            metavar="MODEL",
            complete="component",
        ),
    ]


class BlackBoxCommand(RecordArgument, InputsOption, SamplePeriodOption, StudyOptions, JsonOption):
    """Options of ``ppy black-box``."""

    report: Annotated[File, "The page (.html)."]
    out: Annotated[File, "The model as a class (.py), for ppy build, simulate and diagnose."]
    output: Annotated[str, Option("Column to predict.", default=REQUIRED, metavar="COLUMN")]


# --- diagnoses -----------------------------------------------------------------------------------


class JudgedOptions(RecordsArgument):
    """The records of a diagnosis, and its model."""

    model: Annotated[
        str | None,
        Option(
            "A component (see ppy list), path/to/file.py:Class, or any FMU; default: the first of"
            " ppy list.",
            metavar="MODEL",
            complete="component",
        ),
    ]


class SystemOption(TypedDict):
    """The system whose members are judged in place of one model."""

    system: Annotated[
        str | None,
        Option(
            "Judge the members of a system, by its name or its file, on one record.",
            metavar="NAME|S.ssp",
            complete="system",
        ),
    ]


VERDICTS = ("consistent", "recalibrate", "cause", "ambiguous", "unexplained")


class DiagnoseCommand(
    JudgedOptions,
    EachOption,
    LaidOverOption,
    DiagnoseOptions,
    JsonOption,
    ReportOption,
    PlatformsOption,
    SystemOption,
    IsolateOption,
):
    """Options of ``ppy diagnose``."""

    explain: Annotated[
        Names, Option("Compare two candidates, e.g. friction(velocity),nothing.", metavar="A,B")
    ]
    require: Annotated[
        Sequence[str],
        names_among(VERDICTS),
        Option(
            f"Exit status 1 unless the verdict is one of these: {', '.join(VERDICTS)}.",
            metavar="VERDICTS",
        ),
    ]
    fmu: Annotated[File, "The extended model as FMU: F.fmu (native) and F.python.fmu beside it."]
    ssp: Annotated[
        File, Option("An FMU without equations with its correction, as a system.", metavar="S.ssp")
    ]
    experiment: Annotated[
        File, "Experiment (.toml) that would tell alternatives apart, for ppy run."
    ]


class LawsCommand(
    JudgedOptions, LaidOverOption, LawsOptions, JsonOption, ReportOption, PlatformsOption
):
    """Options of ``ppy laws``."""

    effect_out: Annotated[
        File, Option("The best correction as a class to lay over the model.", metavar="F.py")
    ]
    fmu: Annotated[File, "The corrected model as FMU: F.fmu (native) and F.python.fmu beside it."]


# --- systems -------------------------------------------------------------------------------------


class SystemArgument(TypedDict):
    """The system, a positional argument."""

    name: Annotated[
        str,
        Option(
            "A system (see ppy system list) or its file.",
            metavar="NAME_OR_SSP",
            complete="system",
            argument=True,
        ),
    ]


class DrawSystemCommand(SystemArgument):
    """Options of ``ppy system draw``."""

    out: Annotated[File, "Picture (.png, .svg or .pdf); default NAME.png."]


class ExportSystemCommand(SystemArgument, RuntimeOption):
    """Options of ``ppy system export``."""

    connectors: Annotated[
        bool, "Inputs and outputs as connectors of the system; not for libcosim, Ecos."
    ]
    out: Annotated[File, "The .ssp, or a .ssd with resources/; default NAME.ssp."]


class PackSystemCommand(SystemArgument, PlatformsOption):
    """Options of ``ppy system pack``."""

    fmu: Annotated[File, Option("The FMU; default NAME.fmu.", metavar="FILE.fmu")]


class CheckSystemCommand(TypedDict):
    """Options of ``ppy system check``."""

    file: Annotated[Path, Option("System, ours or anybody's.", metavar="FILE.ssp", argument=True)]


# --- rigs ----------------------------------------------------------------------------------------

_ENDPOINT = "tcp://HOST:PORT"
_KEY_FILE = "Key file of a client (ppy rig keys)."


class ServerOptions(TypedDict):
    """The server that a command speaks to."""

    endpoint: Annotated[str, Option("The rig's server.", default=ENDPOINT, metavar=_ENDPOINT)]
    credentials: Annotated[File, _KEY_FILE]


class TunedRunOption(TypedDict):
    """The run whose parameters are moved."""

    run: Annotated[
        str,
        Option(
            "The run with --tunable, on this machine.",
            default=f"tcp://127.0.0.1:{TUNING_PORT}",
            metavar=_ENDPOINT,
        ),
    ]


class TuneCommand(TunedRunOption):
    """Options of ``ppy rig tune``."""

    move: Annotated[
        str | None,
        Option(
            "Parameter, its new value, and the most that it changes in a second; by default the"
            " change takes 5 s. Without one all are shown.",
            metavar="NAME=VALUE[@SLEW]",
            argument=True,
        ),
    ]


class WatchCommand(ServerOptions, TunedRunOption):
    """Options of ``ppy rig watch``."""

    port: Annotated[
        int,
        Option(
            "Of the page, on this machine; 0 takes a free one.", default=8765, least=0, most=65535
        ),
    ]
    browser: Annotated[
        bool, Option("Open the page in a browser.", default=True, flag="--browser/--no-browser")
    ]
    archive: Annotated[
        File, Option("Archive of the server, for a page with its history.", metavar="FOLDER")
    ]
    rise: Annotated[
        Percent, "Alarm once the impedance of the actuator has risen by that, e.g. 15%."
    ]


def _timeout(default: float) -> Option:
    return Option("How long to wait for an answer, in s.", default=default, least=0.05, most=60.0)


class TimeoutOption(TypedDict):
    """The time that an answer may take."""

    timeout: Annotated[float, _timeout(2.0)]


class StopCommand(ServerOptions, TimeoutOption, JsonOption):
    """Options of ``ppy rig stop``."""

    reason: Annotated[str, Option("For the log.", default="ppy rig stop", metavar="TEXT")]


class AcknowledgeCommand(ServerOptions, JsonOption):
    """Options of ``ppy rig acknowledge``."""

    timeout: Annotated[float, _timeout(5.0)]
    latch: Annotated[
        str | None, Option("Name of the latch that is meant, as status has it.", metavar="NAME")
    ]
    alarm: Annotated[
        str | None,
        Option("Name of an alarm, which is acknowledged in place of a latch.", metavar="NAME"),
    ]
    shelve: Annotated[
        float | None,
        Option("Show no alarm of its source for so many seconds; 0 ends that.", metavar="SECONDS"),
    ]


class LogCommand(TypedDict):
    """Options of ``ppy rig log``."""

    files: Annotated[
        list[Path], Option("Files of one log, the oldest first.", metavar="FILE...", argument=True)
    ]


class StatusCommand(ServerOptions, TimeoutOption, JsonOption):
    """Options of ``ppy rig status``."""


class RecordRigCommand(ExperimentSettingsOption, ServerOptions):
    """Options of ``ppy rig record``."""

    rate: Annotated[
        float | None, Option("Rows a second; default those of the experiment.", metavar="HZ")
    ]
    max_age: Annotated[Seconds, "Older values become gaps; default two steps."]
    stimulus: Annotated[
        str | None,
        Option(
            "Experiment whose inputs drive the rig, as for ppy run; without one it is only heard.",
            metavar="FILE.toml|NAME",
            complete="experiment",
        ),
    ]
    duration: Annotated[
        Seconds,
        Option("How long the rig is heard, e.g. 10min; default until Ctrl-C.", flag="--for"),
    ]
    out: Annotated[Path, Option("Record: .nc, .parquet or .csv.", default=REQUIRED, metavar="FILE")]
    take_over: Annotated[bool, "Go on from a client that hands the rig over."]


class ArchiveCommand(JsonOption):
    """Options of ``ppy rig archive``."""

    folder: Annotated[Path, Option("Folder of the archive.", metavar="FOLDER", argument=True)]
    since: Annotated[
        str | None,
        Option(
            "Begin of the part, such as '2026-11-29 18:30'; local time unless it says another.",
            flag="--from",
            metavar="DATE",
        ),
    ]
    until: Annotated[str | None, Option("End of the part.", flag="--to", metavar="DATE")]
    out: Annotated[File, "Record of the part: .nc, .parquet or .csv."]


class BridgeCommand(TypedDict):
    """Options of ``ppy rig bridge``."""

    endpoint: Annotated[str, Option("The rig's server.", default=REQUIRED, metavar=_ENDPOINT)]
    credentials: Annotated[Path, Option(_KEY_FILE, default=REQUIRED, metavar="FILE")]
    port: Annotated[
        int,
        Option(
            "On this machine; the two above it are taken, too.", default=PORT, least=1, most=65533
        ),
    ]
    no_keys: _NoKeys


class KeysCommand(TypedDict):
    """Options of ``ppy rig keys``."""

    folder: Annotated[
        Path, Option("Where the key files go, or are.", metavar="FOLDER", argument=True)
    ]
    client: Annotated[
        str | None, Option("Make keys for one more client of the server there.", metavar="NAME")
    ]
    role: Annotated[
        str | None,
        Option(
            "Permission of that client: watch (and stop), command, or acknowledge (all there is).",
            metavar="ROLE",
        ),
    ]


class ServeCommand(TypedDict):
    """Options of ``ppy rig serve``."""

    backend: Annotated[
        str,
        Option(
            "emulator, replay, nidaqmx, visa, serial, modbus, or FILE.py:Class.",
            default="emulator",
            metavar="NAME",
        ),
    ]
    backend_options: Annotated[
        Texts, Option("Handed on to the backend; repeatable.", flag="--option")
    ]
    rate: Annotated[float, Option("Samples per second, up to 1000.", default=30.0)]
    watchdog: Annotated[
        float | None,
        "How long the rig goes on without a fresh command, in s; default 0.2, or more where"
        " other programs may delay the server.",
    ]
    lockstep: Annotated[bool, "The rig waits for the client; emulator and replay only."]
    endpoint: Annotated[
        str | None, Option("Where to bind; the two ports above are taken, too.", metavar=_ENDPOINT)
    ]
    host: Annotated[
        str | None,
        Option(
            "Address to bind to; beyond 127.0.0.1 with --keys only.", flag="--bind", metavar="HOST"
        ),
    ]
    port: Annotated[Number, "Port, 5570 if not given; 0 is any free one."]
    keys: Annotated[File, "Key file of the server, of ppy rig keys."]
    no_keys: _NoKeys
    log: Annotated[File, "Add every line to this file, too."]
    archive: Annotated[
        File, Option("Keep every sample, command and event in files there.", metavar="FOLDER")
    ]
    archive_size: Annotated[
        float, SIZE, Option("Largest size of the archive; the oldest files go.", default=1e9)
    ]
    state: Annotated[
        File, Option("Keeps the latch of each device; default is the user's.", metavar="FOLDER")
    ]
    priority: Annotated[
        Number,
        Option("Real-time priority of the device's process, 1 to 99.", flag="--device-priority"),
    ]
    cpu: Annotated[Number, Option("Core that the device's process stays on.", flag="--device-cpu")]
    stuck_after: Annotated[
        int,
        Option(
            "Samples after which a stuck sensor or an ignored write is an alarm; 0 is never.",
            default=100,
        ),
    ]
    alarm_hook: Annotated[
        str | None,
        Option(
            "Called once an alarm, with it as JSON: a program's argument, or a POST.",
            metavar="PROGRAM|URL",
        ),
    ]
