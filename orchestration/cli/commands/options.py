"""Options of each command: those of Python, those that commands share, and its own.

No ``from __future__ import annotations``: see `orchestration.api.options`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypedDict

from fmus.rig_proxy import ENDPOINT, PORT
from orchestration.api.declaration import REQUIRED, Option
from orchestration.api.forms import (
    ASSIGNMENTS,
    NAMES,
    PERCENT,
    SIZE,
    TEXTS,
    TIME,
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
    TuningOptions,
    tolerances,
)

# --- components and FMUs -------------------------------------------------------------------------


class ReportOption(TypedDict, total=False):
    """The page of a result."""

    report: Annotated[Path | None, Option("Page (.html) with all of it, to look at and pass on.")]


class InfoCommand(LaidOverOption, ReadingOptions, JsonOption, ReportOption, total=False):
    """Options of ``ppy info``."""

    model: Annotated[
        str,
        Option(
            "A component (see ppy list), path/to/file.py:Class, an .fmu file; a record; or a"
            " diagnosis (.json), which is shown as it was.",
            default=REQUIRED,
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


class CheckCommand(JsonOption, JunitOption, total=False):
    """Options of ``ppy check``."""

    fmus: Annotated[
        list[Path],
        Option("FMU files, ours or anybody's.", default=REQUIRED, metavar="FMU...", argument=True),
    ]
    accept: Annotated[
        Path | None,
        Option("Findings that do not count, each with its reason (.toml).", metavar="FILE"),
    ]
    fail_on: Annotated[
        str,
        Option(
            "Exit status 1 from such a finding on: error (default), warning or note.",
            default="error",
            metavar="SEVERITY",
            choices=("error", "warning", "note"),
        ),
    ]


class BuildOptions(TypedDict, total=False):
    """The builds that are made, and where they go."""

    names: Annotated[
        list[str] | None,
        Option(
            "Components, path/to/file.py:Class, or FMUs built from these; default all components.",
            metavar="[MODEL]...",
            complete="component",
            argument=True,
        ),
    ]
    runtime: Annotated[
        str,
        Option(
            "python, native or both; pythonfmu: a stock archive of that.",
            default="both",
            choices=("python", "native", "both", "pythonfmu"),
        ),
    ]
    fmi: Annotated[
        int,
        Option("Version of FMI, 2 or 3; 3 in OUT/fmi3 and OUT/fmi3-python.", default=2),
    ]
    clocks: Annotated[
        bool, Option("Declare when states are sampled, as clocks of FMI 3.0.", default=False)
    ]
    out: Annotated[Path, Option("Folder that gets RUNTIME/NAME.fmu.", default=Path("fmu"))]


class BuildCommand(LaidOverOption, SettingsOption, PlatformsOption, BuildOptions, total=False):
    """Options of ``ppy build``."""


class ExportOptions(TypedDict, total=False):
    """The components that are written, and where they go."""

    names: Annotated[
        list[str] | None,
        Option(
            "Components, path/to/file.py:Class, or FMUs built from these; default all components.",
            metavar="[MODEL]...",
            complete="component",
            argument=True,
        ),
    ]
    out: Annotated[Path, Option("Folder that gets the package.", default=Path("modelica"))]
    fmus: Annotated[bool, Option("Also models that FMUs for this machine compute.", default=False)]
    fitted: Annotated[
        Path | None,
        Option("Parameters from a fit (ppy identify --json), as defaults.", metavar="FILE"),
    ]


class ExportModelicaCommand(LaidOverOption, SettingsOption, ExportOptions, total=False):
    """Options of ``ppy export modelica``."""


class NewOptions(TypedDict, total=False):
    """Options of the template that is written, and of its place."""

    kind: Annotated[
        str,
        Option(
            "component, effect or backend.",
            default=REQUIRED,
            metavar="KIND",
            argument=True,
            choices=("component", "effect", "backend"),
        ),
    ]
    name: Annotated[
        str,
        Option(
            "In small letters, such as dry_friction.",
            default=REQUIRED,
            metavar="NAME",
            argument=True,
        ),
    ]


class NewCommand(NewOptions, ModelOption, total=False):
    """Options of ``ppy new``."""

    law: Annotated[
        str,
        Option("Law of the model that an effect changes; any other lists them.", default=""),
    ]
    out: Annotated[Path, Option("Folder that gets the files.", default=Path("."))]


# --- simulations ---------------------------------------------------------------------------------


class InputFileOption(TypedDict, total=False):
    """The record that drives a simulation."""

    input_file: Annotated[
        Path | None,
        Option("Record with the inputs, held between samples.", flag="--input"),
    ]


class SignalsOption(TypedDict, total=False):
    """The signals of a simulation as a file."""

    out: Annotated[
        Path | None,
        Option("Inputs and outputs, with units: .csv, .nc or .parquet.", metavar="FILE"),
    ]


class RunFilesOptions(TypedDict, total=False):
    """Files of a simulation of one FMU beside its signals."""

    log_calls: Annotated[
        Path | None,
        Option("Each call of the FMU, with arguments and status, a line each.", metavar="FILE"),
    ]
    state_in: Annotated[
        Path | None,
        Option("Go on from the state that --state-out wrote, at its time.", metavar="FILE"),
    ]
    state_out: Annotated[Path | None, Option("State of the FMU at the last point.", metavar="FILE")]


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
    SignalsOption,
    RunFilesOptions,
    PlotOption,
    RuntimeOption,
    IsolationOptions,
    total=False,
):
    """Options of ``ppy simulate``."""


class ExperimentOptions(TypedDict, total=False):
    """The experiment that is run, and its result."""

    experiment: Annotated[
        str | None,
        Option(
            "One of --list, a file, a system, or a result to make again.",
            metavar="NAME|FILE.toml|SYSTEM.ssp|RESULT",
            complete="experiment",
            argument=True,
        ),
    ]
    settings: Annotated[
        Sequence[str],
        Option(
            "Over the file: duration=20s, R1=610mohm, inputs.current.value=1, or parameters of a"
            " file: specimen.toml, MEMBER@specimen.toml.",
            default=(),
            flag="--set",
            alias="--params",
            metavar="KEY=VALUE",
            form=ASSIGNMENTS,
        ),
    ]
    out: Annotated[
        Path | None,
        Option("Result: .nc, .parquet (both can be run again) or .csv.", metavar="FILE"),
    ]
    plot: Annotated[
        Path | None, Option("Picture (.png, .svg, .pdf) or page (.html).", metavar="FILE")
    ]


class ListOption(TypedDict, total=False):
    """The list of what can be run, printed in place of a run."""

    show_list: Annotated[
        bool, Option("List the experiments that ship.", default=False, flag="--list")
    ]


class RunToleranceOption(TypedDict, total=False):
    """By how much a result that is made again may differ."""

    tube: Annotated[
        Any,
        tolerances(
            "By how much a result made again may differ, as 'voltage=1mV, omega=0.5%' of its range;"
            " default not at all.",
            "--tolerance",
        ),
    ]


class RunCommand(
    ExperimentOptions,
    RunToleranceOption,
    ReportOption,
    JsonOption,
    JunitOption,
    RuntimeOption,
    RealTimeOptions,
    TuningOptions,
    IsolationOptions,
    ListOption,
    total=False,
):
    """Options of ``ppy run``."""


class RangesOption(TypedDict, total=False):
    """Values over which parameters vary."""

    over: Annotated[
        Sequence[str],
        Option(
            "Range of a parameter, or of an input that is held: R1=0.3..0.7:41,"
            " C=1e-3..1e-1:7 log, k1=6.3N/mm, 9N/mm; R1=0.3..0.7 for a design that chooses the"
            " values. Repeatable.",
            default=(),
            metavar="NAME=FROM..TO:COUNT",
            form=TEXTS,
        ),
    ]


class OverOption(RangesOption, total=False):
    """Values over which parameters of a sweep vary."""

    fitted: Annotated[
        Path | None,
        Option(
            "Draw parameters from a fit (ppy identify --json): --samples of them, and bands of the"
            " outputs.",
            metavar="FILE",
        ),
    ]


class DatasetOption(TypedDict, total=False):
    """The result of a sweep as a file."""

    out: Annotated[
        Path | None,
        Option(
            "Result with units: .nc, or .zarr for more than fits into memory. Interrupted, the same"
            " command goes on.",
            metavar="FILE",
        ),
    ]


class SweepCommand(
    RunnableArgument,
    OverOption,
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
    total=False,
):
    """Options of ``ppy sweep``."""


# --- linear models -------------------------------------------------------------------------------


class MatOption(TypedDict, total=False):
    """The matrices as a MATLAB file."""

    mat: Annotated[
        Path | None, Option("A, B, C, D with names and units, for MATLAB (.mat).", metavar="FILE")
    ]


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
    MatOption,
    PlotOption,
    total=False,
):
    """Options of ``ppy linearise``."""


class DesignFolderOption(TypedDict, total=False):
    """The folder of a designed controller."""

    out: Annotated[
        Path | None,
        Option(
            "Folder for controller.py, controller.fmu, loop.ssp and step.toml, which runs it.",
            metavar="FOLDER",
        ),
    ]


class DesignCommand(
    RunnableArgument,
    LaidOverOption,
    DesignOptions,
    RangesOption,
    BandOptions,
    DesignFolderOption,
    JsonOption,
    PlotOption,
    total=False,
):
    """Options of ``ppy design``."""


# --- optimisation --------------------------------------------------------------------------------


class SearchedOption(TypedDict, total=False):
    """The parameters of an optimisation."""

    over: Annotated[
        list[str],
        Option(
            "Range of a parameter that is searched: r_po=30..45mm, C=1e-3..1e-1 log. Repeatable.",
            default=REQUIRED,
            metavar="NAME=FROM..TO",
        ),
    ]


class OptimiseCommand(
    ModelArgument,
    SearchedOption,
    OptimiseOptions,
    LaidOverOption,
    SettingsOption,
    PresetOption,
    GridOptions,
    JsonOption,
    PlotOption,
    total=False,
):
    """Options of ``ppy optimise``."""


# --- a model and a record ------------------------------------------------------------------------


class FiguresOption(TypedDict, total=False):
    """The figures of a comparison as a file."""

    out: Annotated[Path | None, Option("The figures as JSON (.json).", metavar="FILE")]


class MeasuringOptions(
    RunnableOption,
    LaidOverOption,
    MappingOption,
    SettingsOption,
    PresetOption,
    ToleranceOption,
    total=False,
):
    """A model, and how a record that it is compared with is read."""


class MeasuredOptions(RecordArgument, MeasuringOptions, total=False):
    """A model, and the record that it is compared with."""


class RequiredPercentOption(TypedDict, total=False):
    """The fit in percent that a comparison must reach."""

    require: Annotated[
        float | None,
        Option(
            "Exit status 1 unless every output fits that well, such as 95%; after --fit if given.",
            metavar="PERCENT",
            form=PERCENT,
        ),
    ]


class ReferenceOptions(TypedDict, total=False):
    """A result that another one is compared with, and by how much it may differ."""

    reference: Annotated[
        Path | None,
        Option(
            "Compare two files: this is right, RECORD a result. Not with a model.", argument=True
        ),
    ]
    tube: Annotated[
        Any,
        tolerances(
            "With a REFERENCE: 20ms,1% of its range around it; v=1mV for one signal; default the"
            " last bit.",
            "--tube",
        ),
    ]


class CompareCommand(
    MeasuredOptions,
    ReferenceOptions,
    FittedOption,
    RequiredPercentOption,
    FiguresOption,
    JsonOption,
    JunitOption,
    PlotOption,
    ReportOption,
    RuntimeOption,
    IsolateOption,
    total=False,
):
    """Options of ``ppy compare``."""


class RequiredFitOption(TypedDict, total=False):
    """The parameters to identify."""

    fit: Annotated[
        list[str],
        Option(
            "Parameters, e.g. R1,R2,C.",
            default=REQUIRED,
            form=some_of("name the parameters, e.g. R1,R2,C"),
        ),
    ]


class ProfileOptions(TypedDict, total=False):
    """Likelihood profiles of parameters, and the identified values as a file."""

    profile: Annotated[
        list[str] | None,
        Option(
            "Of the fitted ones: an interval by the likelihood itself.",
            metavar="PARAMETERS",
            form=NAMES,
        ),
    ]
    profile_plot: Annotated[
        Path | None,
        Option("The profiles as a picture (.png, .svg or .pdf).", metavar="FILE"),
    ]
    posterior: Annotated[
        int | None,
        Option(
            "Independent samples of the posterior, e.g. 1000; needs the extra sampling.",
            least=1,
            metavar="N",
        ),
    ]
    corner: Annotated[
        Path | None,
        Option("The posterior of all pairs as a picture (.png, .svg or .pdf).", metavar="FILE"),
    ]
    ssv: Annotated[
        Path | None,
        Option("The values as a parameter set (.ssv), for any system.", metavar="FILE"),
    ]


class IdentifyCommand(
    RecordsArgument,
    MeasuringOptions,
    RequiredFitOption,
    AssumptionOptions,
    WorkersOption,
    ProfileOptions,
    JsonOption,
    PlotOption,
    ReportOption,
    IsolateOption,
    total=False,
):
    """Options of ``ppy identify``."""


class AgedRecordsArgument(TypedDict, total=False):
    """Records of one actuator in the order of use."""

    records: Annotated[
        list[Path],
        Option(
            "Measured records in the order of use; a folder stands for its files, by name.",
            default=REQUIRED,
            metavar="RECORD|FOLDER...",
            argument=True,
        ),
    ]


class AgeCommand(
    AgedRecordsArgument,
    RunnableOption,
    MappingOption,
    SettingsOption,
    AgeOptions,
    JsonOption,
    PlotOption,
    ReportOption,
    total=False,
):
    """Options of ``ppy age``."""

    out: Annotated[Path | None, Option("Windows with their intervals (.csv).", metavar="FILE")]


class BesideOption(TypedDict, total=False):
    """A model whose response is compared with the measured one."""

    model: Annotated[
        str | None,
        Option(
            "Shown with the record: a component (see ppy list), path/to/file.py:Class, an .fmu"
            " file, or a system: its name or .ssp file.",
            metavar="MODEL",
            complete="component",
        ),
    ]


class ResponsesOption(TypedDict, total=False):
    """The responses as a file."""

    out: Annotated[Path | None, Option("Responses with their intervals (.csv).", metavar="FILE")]


class FrequencyCommand(
    RecordArgument,
    BesideOption,
    LaidOverOption,
    MappingOption,
    SettingsOption,
    PresetOption,
    UnitsOption,
    ResponseOptions,
    ResponsesOption,
    JsonOption,
    PlotOption,
    IsolateOption,
    total=False,
):
    """Options of ``ppy frequency``."""


class OutputOption(TypedDict, total=False):
    """The column that a black-box model predicts."""

    output: Annotated[str, Option("Column to predict.", default=REQUIRED, metavar="COLUMN")]


class BlackBoxOutputs(TypedDict, total=False):
    """The files of a black-box identification."""

    report: Annotated[Path | None, Option("The page (.html).", metavar="FILE")]
    out: Annotated[
        Path | None,
        Option("The model as a class (.py), for ppy build, simulate and diagnose.", metavar="FILE"),
    ]


class BlackBoxCommand(
    RecordArgument,
    OutputOption,
    InputsOption,
    SamplePeriodOption,
    StudyOptions,
    JsonOption,
    BlackBoxOutputs,
    total=False,
):
    """Options of ``ppy black-box``."""


# --- diagnoses -----------------------------------------------------------------------------------


class JudgedOptions(RecordsArgument, total=False):
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


class DiagnoseOutputs(TypedDict, total=False):
    """Files that a diagnosis writes, other than figures and page."""

    fmu: Annotated[
        Path | None,
        Option("The extended model as FMU: F.fmu (native) and F.python.fmu beside it."),
    ]
    ssp: Annotated[
        Path | None,
        Option("An FMU without equations with its correction, as a system.", metavar="S.ssp"),
    ]
    experiment: Annotated[
        Path | None,
        Option("Experiment (.toml) that would tell alternatives apart, for ppy run."),
    ]


class SystemOption(TypedDict, total=False):
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


class RequiredVerdictOption(TypedDict, total=False):
    """Verdicts of which a diagnosis must reach one."""

    require: Annotated[
        Sequence[str],
        Option(
            f"Exit status 1 unless the verdict is one of these: {', '.join(VERDICTS)}.",
            default=(),
            metavar="VERDICTS",
            form=names_among(VERDICTS),
        ),
    ]


class ExplainOption(TypedDict, total=False):
    """Two candidates that are compared."""

    explain: Annotated[
        Sequence[str],
        Option(
            "Compare two candidates, e.g. friction(velocity),nothing.",
            default=(),
            metavar="A,B",
            form=NAMES,
        ),
    ]


class DiagnoseCommand(
    JudgedOptions,
    EachOption,
    LaidOverOption,
    DiagnoseOptions,
    RequiredVerdictOption,
    ExplainOption,
    JsonOption,
    ReportOption,
    DiagnoseOutputs,
    PlatformsOption,
    SystemOption,
    IsolateOption,
    total=False,
):
    """Options of ``ppy diagnose``."""


class LawsOutputs(TypedDict, total=False):
    """Files that a search of laws writes, other than figures and page."""

    effect_out: Annotated[
        Path | None,
        Option("The best correction as a class to lay over the model.", metavar="F.py"),
    ]
    fmu: Annotated[
        Path | None,
        Option("The corrected model as FMU: F.fmu (native) and F.python.fmu beside it."),
    ]


class LawsCommand(
    JudgedOptions,
    LaidOverOption,
    LawsOptions,
    JsonOption,
    ReportOption,
    LawsOutputs,
    PlatformsOption,
    total=False,
):
    """Options of ``ppy laws``."""


# --- systems -------------------------------------------------------------------------------------


class SystemArgument(TypedDict, total=False):
    """The system, a positional argument."""

    name: Annotated[
        str,
        Option(
            "A system (see ppy system list) or its file.",
            default=REQUIRED,
            metavar="NAME_OR_SSP",
            complete="system",
            argument=True,
        ),
    ]


class DrawSystemCommand(SystemArgument, total=False):
    """Options of ``ppy system draw``."""

    out: Annotated[
        Path | None,
        Option("Picture (.png, .svg or .pdf); default NAME.png.", metavar="FILE"),
    ]


class SspOption(TypedDict, total=False):
    """The file that a system is written to."""

    out: Annotated[Path | None, Option("The .ssp, or a .ssd with resources/; default NAME.ssp.")]


class ConnectorsOption(TypedDict, total=False):
    """External connectors of a system."""

    connectors: Annotated[
        bool,
        Option(
            "Inputs and outputs as connectors of the system; not for libcosim, Ecos.",
            default=False,
        ),
    ]


class ExportSystemCommand(SystemArgument, SspOption, RuntimeOption, ConnectorsOption, total=False):
    """Options of ``ppy system export``."""


class PackedOption(TypedDict, total=False):
    """The FMU that a system becomes."""

    fmu: Annotated[Path | None, Option("The FMU; default NAME.fmu.", metavar="FILE.fmu")]


class PackSystemCommand(SystemArgument, PackedOption, PlatformsOption, total=False):
    """Options of ``ppy system pack``."""


class CheckSystemCommand(TypedDict, total=False):
    """Options of ``ppy system check``."""

    file: Annotated[
        Path,
        Option("System, ours or anybody's.", default=REQUIRED, metavar="FILE.ssp", argument=True),
    ]


# --- rigs ----------------------------------------------------------------------------------------

_ENDPOINT = "tcp://HOST:PORT"
_KEY_FILE = "Key file of a client (ppy rig keys)."


class ServerOptions(TypedDict, total=False):
    """The server that a command speaks to."""

    endpoint: Annotated[str, Option("The rig's server.", default=ENDPOINT, metavar=_ENDPOINT)]
    credentials: Annotated[Path | None, Option(_KEY_FILE, metavar="FILE")]


class TunedRunOption(TypedDict, total=False):
    """The run whose parameters are moved."""

    run: Annotated[
        str,
        Option(
            "The run with --tunable, on this machine.",
            default=f"tcp://127.0.0.1:{TUNING_PORT}",
            metavar=_ENDPOINT,
        ),
    ]


class TuneCommand(TunedRunOption, total=False):
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


class WatchCommand(ServerOptions, TunedRunOption, total=False):
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
    archive: Annotated[
        Path | None,
        Option("Archive of the server, for a page with its history.", metavar="FOLDER"),
    ]
    rise: Annotated[
        float | None,
        Option(
            "Alarm once the impedance of the actuator has risen by that, e.g. 15%.",
            metavar="PERCENT",
            form=PERCENT,
        ),
    ]


def _timeout(default: float) -> Option:
    return Option("How long to wait for an answer, in s.", default=default, least=0.05, most=60.0)


class TimeoutOption(TypedDict, total=False):
    """The time that an answer may take."""

    timeout: Annotated[float, _timeout(2.0)]


class LongTimeoutOption(TypedDict, total=False):
    """The time that an answer may take if the rig must act before it answers."""

    timeout: Annotated[float, _timeout(5.0)]


class ReasonOption(TypedDict, total=False):
    """The reason for a stop."""

    reason: Annotated[str, Option("For the log.", default="ppy rig stop", metavar="TEXT")]


class StopCommand(ServerOptions, TimeoutOption, ReasonOption, JsonOption, total=False):
    """Options of ``ppy rig stop``."""


class AcknowledgeCommand(ServerOptions, LongTimeoutOption, JsonOption, total=False):
    """Options of ``ppy rig acknowledge``."""

    latch: Annotated[
        str | None,
        Option("Name of the latch that is meant, as status has it.", metavar="NAME"),
    ]
    alarm: Annotated[
        str | None,
        Option("Name of an alarm, which is acknowledged in place of a latch.", metavar="NAME"),
    ]
    shelve: Annotated[
        float | None,
        Option("Show no alarm of its source for so many seconds; 0 ends that.", metavar="SECONDS"),
    ]


class LogCommand(TypedDict, total=False):
    """Options of ``ppy rig log``."""

    files: Annotated[
        list[Path],
        Option(
            "Files of one log, the oldest first.",
            default=REQUIRED,
            metavar="FILE...",
            argument=True,
        ),
    ]


class StatusCommand(ServerOptions, TimeoutOption, JsonOption, total=False):
    """Options of ``ppy rig status``."""


class RecordingOptions(TypedDict, total=False):
    """The experiment that drives a rig, and the record of it."""

    stimulus: Annotated[
        str | None,
        Option(
            "Experiment whose inputs drive the rig, as for ppy run; without one it is only heard.",
            metavar="FILE.toml|NAME",
            complete="experiment",
        ),
    ]
    duration: Annotated[
        float | None,
        Option(
            "How long the rig is heard, e.g. 10min; default until Ctrl-C.",
            flag="--for",
            metavar="TIME",
            form=TIME,
        ),
    ]
    out: Annotated[Path, Option("Record: .nc, .parquet or .csv.", default=REQUIRED, metavar="FILE")]


class SamplingOptions(TypedDict, total=False):
    """The rows of a record, and changes of the experiment."""

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

    take_over: Annotated[
        bool, Option("Go on from a client that hands the rig over.", default=False)
    ]


class ArchiveOptions(TypedDict, total=False):
    """The archive of a rig, and the part of it that is exported."""

    folder: Annotated[
        Path,
        Option("Folder of the archive.", default=REQUIRED, metavar="FOLDER", argument=True),
    ]
    since: Annotated[
        str | None,
        Option(
            "Begin of the part, such as '2026-11-29 18:30'; local time unless it says another.",
            flag="--from",
            metavar="DATE",
        ),
    ]
    until: Annotated[str | None, Option("End of the part.", flag="--to", metavar="DATE")]
    out: Annotated[
        Path | None, Option("Record of the part: .nc, .parquet or .csv.", metavar="FILE")
    ]


class ArchiveCommand(ArchiveOptions, JsonOption, total=False):
    """Options of ``ppy rig archive``."""


class BridgeCommand(TypedDict, total=False):
    """Options of ``ppy rig bridge``."""

    endpoint: Annotated[str, Option("The rig's server.", default=REQUIRED, metavar=_ENDPOINT)]
    credentials: Annotated[Path, Option(_KEY_FILE, default=REQUIRED, metavar="FILE")]
    port: Annotated[
        int,
        Option(
            "On this machine; the two above it are taken, too.", default=PORT, least=1, most=65533
        ),
    ]
    no_keys: Annotated[
        bool,
        Option("Everybody on this machine may drive the rig, without a key.", default=False),
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
    role: Annotated[
        str | None,
        Option(
            "Permission of that client: watch (and stop), command, or acknowledge (all there is).",
            metavar="ROLE",
        ),
    ]


class ServeCommand(TypedDict, total=False):
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
        float | None,
        Option(
            "How long the rig goes on without a fresh command, in s; default 0.2, or more where"
            " other programs may delay the server."
        ),
    ]
    lockstep: Annotated[
        bool, Option("The rig waits for the client; emulator and replay only.", default=False)
    ]
    endpoint: Annotated[
        str | None,
        Option("Where to bind; the two ports above are taken, too.", metavar=_ENDPOINT),
    ]
    host: Annotated[
        str | None,
        Option(
            "Address to bind to; beyond 127.0.0.1 with --keys only.", flag="--bind", metavar="HOST"
        ),
    ]
    port: Annotated[int | None, Option("Port, 5570 if not given; 0 is any free one.", metavar="N")]
    keys: Annotated[Path | None, Option("Key file of the server, of ppy rig keys.", metavar="FILE")]
    no_keys: Annotated[
        bool,
        Option("Everybody on this machine may drive the rig, without a key.", default=False),
    ]
    log: Annotated[Path | None, Option("Add every line to this file, too.", metavar="FILE")]
    archive: Annotated[
        Path | None,
        Option("Keep every sample, command and event in files there.", metavar="FOLDER"),
    ]
    archive_size: Annotated[
        float,
        Option(
            "Largest size of the archive; the oldest files go.",
            default=1e9,
            metavar="SIZE",
            form=SIZE,
        ),
    ]
    state: Annotated[
        Path | None,
        Option("Keeps the latch of each device; default is the user's.", metavar="FOLDER"),
    ]
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
