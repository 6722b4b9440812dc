"""Options of the functions of ``import ppy_rig as ppy``, most of them also of the command line.

``ppy COMMAND --help`` reads this module, so it imports nothing heavy: types of heavy modules are in
quotes. ``from __future__ import annotations`` would turn all annotations into texts, with which the
options in them could not be read.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

from orchestration.api.declaration import Option, options_of
from orchestration.api.forms import (
    BAND,
    EFFECTS,
    LATER,
    LEFT_OUT,
    LIMITS,
    MAPPING,
    NAMES,
    ONE_OR_ALL,
    PARAMETERS,
    PERCENT,
    RATE,
    RATIOS,
    RECORDS,
    ROWS,
    SEGMENT,
    SETTINGS,
    TIME,
    TIMES,
    File,
    Names,
    Number,
    Rate,
    Settings,
    Time,
    numbers,
    rows_per_second,
    seconds,
    some_of,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from orchestration.api.records import Records
    from orchestration.fmu.isolation import Limits
    from orchestration.records import Arrays, Record, Source
    from orchestration.sweeps import Design, Task


Seed = Annotated[int, Option("Seed of random numbers.", default=0, least=0)]
_Assumed = Annotated[Mapping[str, Any] | None, SETTINGS]

# --- options of several functions ----------------------------------------------------------------


class ReadingOptions(TypedDict, total=False):
    """Form of a table that its file does not tell, and the part of it that is used."""

    columns: Annotated[
        Names,
        Option(
            "Names of the columns of a file without a header, e.g. time=s,current=A.",
            "Names of the columns of a file without a header, as ``name`` or ``name=unit``.",
            metavar="NAME=UNIT,...",
        ),
    ]
    rate: Annotated[
        Rate,
        "Rows a second of a file without a time, e.g. 100Hz, or the time between two, 10ms.",
        "Rows per second of a file without a time.",
    ]
    decimal: Annotated[
        str | None,
        Option(
            "Decimal mark of numbers such as 1,230 that a file leaves open: comma or point.",
            choices=("comma", "point"),
        ),
    ]
    table: Annotated[
        str | None, "Name or number of the table, of a file that has several, such as sheets."
    ]
    begin: Annotated[Time, "First time that is used, e.g. 30s."]
    end: Annotated[Time, "Last time that is used, e.g. 2min."]
    rows: Annotated[
        tuple[int, int] | None,
        ROWS,
        "First and last row that is used, numbered as in messages, e.g. 100..2000.",
    ]
    segment: Annotated[
        Mapping[str, str] | None,
        SEGMENT,
        "Rows that are used by their label in a column, e.g. CYCLE=3 or STEP=2,4. Repeatable.",
        'Labels, separated by commas, of the used rows by column: ``{"CYCLE": "3"}``.',
    ]
    discard: Annotated[
        float,
        PERCENT,
        Option(
            "Largest share of the rows that repairs may leave out, e.g. 5%; default 1%.",
            "Largest share of the rows that repairs may leave out, in percent.",
            default=1.0,
        ),
    ]


def source_of(data: "str | Path | Arrays", options: Mapping[str, Any]) -> "Source":
    """Return a file or arrays that is read as values of `ReadingOptions` say."""
    from orchestration.records import Source

    in_si: dict[str, Callable[[Any], Any]] = {
        "columns": tuple,
        "rate": rows_per_second,
        "begin": seconds,
        "end": seconds,
    }
    given = {
        name: in_si.get(name, lambda value: value)(options[name])
        for name in options_of(ReadingOptions)
        if options.get(name) is not None
    }
    return Source.of(data, **given)


class MappingOption(ReadingOptions, total=False):
    """Names of columns that differ from those of the model's signals."""

    mapping: Annotated[
        Mapping[str, str] | None,
        MAPPING,
        "Column of a signal, e.g. U_cell=voltage or stress=force[N]. Repeatable.",
        'Signal of the model by column of a file, such as ``{"stress": "force[N]"}``.',
    ]


class SettingsOption(TypedDict, total=False):
    """Values of parameters of a model."""

    settings: Annotated[
        Mapping[str, float | str] | None,
        PARAMETERS,
        Option(
            "Set a parameter, e.g. R1=0.61 or k1=6.3N/mm, or those of a file: specimen.toml or"
            " values.ssv, or MEMBER@specimen.toml in a system. Repeatable.",
            "Values of parameters, which are start values of a fit, and of constant inputs:"
            ' numbers in the model\'s units, or texts with a unit such as ``"6.3 N/mm"``; or a'
            " ``.toml`` file with a table ``[parameters]`` of them, or a parameter set, ``.ssv``.",
            alias="--params",
        ),
    ]


class UnitsOption(TypedDict, total=False):
    """Units that an FMU does not declare."""

    units: Annotated[
        Mapping[str, str] | None,
        SETTINGS,
        Option(
            "Unit of a variable of which the FMU declares none, e.g. omega=rad/s. Repeatable.",
            "Units of variables of which the FMU declares none.",
            metavar="NAME=UNIT",
        ),
    ]


class RunsOptions(TypedDict, total=False):
    """Records of one file, and the parameters that are not shared by records."""

    runs: Annotated[
        str | None,
        Option(
            "Column that labels the records in a file; default a clock that restarts.",
            "Column of a file that labels its records; by default a clock that restarts divides"
            " them.",
            metavar="COLUMN",
        ),
    ]
    each: Annotated[
        Names,
        "Parameters that differ from record to record, e.g. ocv,R0.",
        "Parameters that differ from record to record.",
    ]


class RecordOptions(MappingOption, RunsOptions, total=False):
    """Records of a diagnosis: columns, runs, common parameters, validation data."""

    holdout: Annotated[
        "Records | None",
        RECORDS,
        "A record for validation, or labels such as 7,8,9 of some of the records; default the"
        " last third. Repeatable.",
        "Other records for validation, or labels of some of the records, such as"
        ' ``"7,8,9"``. By default the last third of the record, or of several records.',
    ]
    interpolate: Annotated[
        bool | None,
        Option(
            "Inputs are linear between samples, or constant; default estimated from the record.",
            "Whether inputs are linear between samples, or constant; by default this is estimated"
            " from the record.",
            flag="--interpolate/--no-interpolate",
        ),
    ]


class SearchOptions(SettingsOption, total=False):
    """Search for a cause: start values, known parameters, processor time."""

    hold: Annotated[
        Names,
        "Parameters that are known and not fitted, e.g. mass,R1; see --set. A diagnosis also takes"
        " inputs that the experiment of --experiment cannot set, such as a disturbance.",
        "Parameters that are known and not fitted. A diagnosis also takes inputs that an experiment"
        " cannot set, such as a disturbance.",
    ]
    time: Annotated[
        Time,
        "Processor time of each search, e.g. 60s, then the best answer so far; else no end.",
        "Processor time of the search, after which the best answer so far is returned with a"
        " note; by default it has no end. With a later record to compare it applies to each of"
        " three searches.",
    ]


class ProgressOption(TypedDict, total=False):
    """Reports of progress as texts."""

    progress: Annotated[
        Callable[[str], None],
        Option(doc="Called with a text about each step of the work.", default=lambda text: None),
    ]


# --- diagnose and laws ---------------------------------------------------------------------------


class DiagnoseOptions(RecordOptions, SearchOptions, UnitsOption, total=False):
    """Options of ``diagnose`` besides the record and the model."""

    effects: Annotated[
        Sequence[str] | None,
        EFFECTS,
        Option(
            "Effects that may be causes by name, e.g. diffusion,sensor_lag(voltage), or none; by"
            " default, or as families, all that the model lists. Any input has some, e.g."
            " dead_zone(voltage).",
            "Effects that may be causes by name, as ``id``, ``id(output)`` or ``id(input)``, or"
            ' none. By default, or as ``["families"]``, all that the model lists. Terms of the laws'
            " are searched beside them; see ``laws``.",
            complete="effect",
        ),
    ]
    fit: Annotated[
        Names,
        "Parameters that are fitted, all others being held; of an FMU without equations those"
        " that are fitted too, e.g. p1,p2.",
        "Parameters of a model with equations that are fitted, all others being held; by"
        " default all are. Of an FMU without equations, parameters that are fitted at all.",
    ]
    compare: Annotated[
        "Record | str | Path | Sequence[Record | str | Path] | None",
        LATER,
        "A later record of the specimen, in which changes are diagnosed. Repeatable, in time.",
        "A later record of the same specimen, or several in time: `DiagnosisResult.changes`"
        " then lists changed parameters, and effects that appeared or disappeared.",
    ]
    laws: Annotated[
        bool,
        LEFT_OUT,
        Option(
            "Leave terms of the laws out of the search: causes are effects by name.",
            "Whether terms of the laws may be causes, beside effects by name. Without effects and"
            " laws parameters alone are fitted.",
            default=True,
            flag="--no-laws",
        ),
    ]


class LawsOptions(RecordOptions, SearchOptions, total=False):
    """Options of ``laws`` besides the record and the model."""

    effects: Annotated[
        Sequence[str] | None,
        EFFECTS,
        Option(
            "Effects that may be causes beside laws, e.g. diffusion; families is all that"
            " the model lists; default none.",
            "Effects that may be causes beside laws, as in `diagnose`. By default none.",
            default=(),
            complete="effect",
        ),
    ]


class EachOption(TypedDict, total=False):
    """Diagnoses of several records, each by itself."""

    workers: Annotated[
        Number,
        Option(
            "Diagnose each record, or each file of a folder, by itself, N at a time in processes.",
            "Diagnose each record, or each file of a folder, by itself, in so many processes; the"
            " answers are those of one after another. It is the ``n_jobs`` of joblib. By default"
            " all records are diagnosed as one.",
            least=1,
            most=1000,
        ),
    ]


class DiagnoseKeywords(DiagnoseOptions, ProgressOption, total=False):
    """Keyword arguments of ``diagnose``."""


class LawsKeywords(LawsOptions, ProgressOption, total=False):
    """Keyword arguments of ``laws``."""


# --- simulate and run ----------------------------------------------------------------------------

_TIMES = "such as 30s, 10ms or 2min, plain numbers in s; default the record's, else the FMU's own."


class OutputsOption(TypedDict, total=False):
    """Variables that are recorded."""

    outputs: Annotated[
        Names,
        "What is recorded: outputs, states, locals, parameters, or all; default the outputs.",
        "Variables that are recorded: outputs, states, locals, parameters, or ``all`` of them;"
        " by default the outputs.",
    ]


class ToleranceOption(UnitsOption, total=False):
    """Accuracy and solver of the integration of an FMU, and units that it does not declare."""

    tolerance: Annotated[
        float | None,
        Option(
            "Relative tolerance that is passed to the FMU; default the one that it declares.",
            "Relative tolerance that is passed to the FMU; by default the one that it declares.",
            metavar="NUMBER",
        ),
    ]
    model_exchange: Annotated[
        bool, "Integrate an FMU file by CVode, though it has a solver of its own, too."
    ]


class GridOptions(TypedDict, total=False):
    """Points in time of a simulation by stop time and step."""

    stop: Annotated[Time, f"Stop time, {_TIMES}", "Last point; by default that of the FMU."]
    step: Annotated[
        Time, f"Communication step, {_TIMES}", "Step between points; by default that of the FMU."
    ]


class PointsOption(TypedDict, total=False):
    """Points in time as an array."""

    time: Annotated[
        "ArrayLike | None",
        Option(
            doc="Points, s; by default a grid with `stop` and `step`, which begins at the start"
            " time that the FMU declares, or at zero.",
            kind="array_like, shape (n,), optional",
        ),
    ]


class IsolateKeyword(TypedDict, total=False):
    """Isolation of one run of an FMU in a process."""

    isolate: Annotated[
        "bool | Limits",
        Option(
            doc="Run the FMU in another process, so that a crash or a hang of the FMU is an error;"
            " with limits that differ from the default.",
            default=False,
            kind="bool or Limits",
        ),
    ]


class SimulateKeywords(
    PointsOption,
    GridOptions,
    SettingsOption,
    OutputsOption,
    ToleranceOption,
    IsolateKeyword,
    total=False,
):
    """Keyword arguments of ``simulate``."""


class RunKeywords(IsolateKeyword, total=False):
    """Keyword arguments of ``run`` for an experiment."""

    settings: Annotated[
        Mapping[str, object] | None,
        Option(
            doc="For an experiment: values that replace those of its file, such as"
            ' ``{"duration": "20 s", "R1": "610 mohm"}``.'
        ),
    ]
    folder: Annotated[
        str | Path | None,
        Option(
            doc="For an experiment with variants: folder that keeps each finished one, so that the"
            " same call resumes after an interrupt; it is not deleted."
        ),
    ]


# --- build ---------------------------------------------------------------------------------------


class BuildKeywords(TypedDict, total=False):
    """Keyword arguments of ``build``."""

    runtime: Annotated[
        str,
        Option(
            doc="Compiled C, laws that Python interprets, or an archive of pythonfmu, with fewer"
            " guarantees.",
            default="native",
            choices=("native", "python", "pythonfmu"),
        ),
    ]
    effects: Annotated[Names, Option(doc="Effects of the catalogue that are added.")]
    platforms: Annotated[
        Sequence[str] | None, NAMES, Option(doc="FMI platforms; default this machine's.")
    ]
    fmi: Annotated[int, Option(doc="Version of FMI, 2 or 3; 3 is native.", default=2)]
    clocks: Annotated[bool, Option(doc="Declare when states are sampled, as clocks of FMI 3.0.")]


# --- compare and fit -----------------------------------------------------------------------------


class WorkersOption(TypedDict, total=False):
    """Number of processes of a fit."""

    workers: Annotated[
        int,
        Option(
            "Processes that run an FMU without equations.",
            "Processes that run an FMU without equations in a fit.",
            default=1,
            metavar="N",
            least=1,
        ),
    ]


class FittedOption(TypedDict, total=False):
    """Parameters that are fitted before a comparison."""

    fit: Annotated[
        Sequence[str],
        some_of("name the parameters to recalibrate, e.g. R1,R2,C"),
        "Parameters to recalibrate, e.g. R1,R2,C.",
        "Parameters that are fitted before the comparison.",
    ]


class AssumptionOptions(RunsOptions, total=False):
    """Assumptions of a fit beyond the parameters that it searches."""

    bounds: Annotated[
        _Assumed,
        Option(
            "Range of a fitted parameter, e.g. R1=0.1..2ohm; an end may be left out. Repeatable.",
            "Ranges of fitted parameters inside those of the model: both ends in its units, or a"
            ' text such as ``"0.1..2ohm"``, of which an end may be left out.',
            kind="Mapping of str to tuple of float or str, optional",
            metavar="NAME=LOW..HIGH",
        ),
    ]
    scale: Annotated[
        Mapping[str, str] | None,
        SETTINGS,
        Option(
            "Search a parameter linear or logarithmic, e.g. k1=linear. Repeatable.",
            "The coordinate in which a parameter is searched, ``linear`` or ``logarithmic``; by"
            " default the logarithm where it is positive by nature.",
            metavar="NAME=SCALE",
        ),
    ]
    prior: Annotated[
        _Assumed,
        Option(
            "Mean and standard deviation known beforehand, e.g. R1=0.43+-0.05ohm. Repeatable.",
            "What is known of a parameter beforehand: mean and standard deviation in the model's"
            ' units, or a text such as ``"0.43+-0.05 ohm"``, also with ``±``.',
            kind="Mapping of str to tuple of float or str, optional",
            metavar="NAME=MEAN+-DEVIATION",
        ),
    ]
    tie: Annotated[
        _Assumed,
        Option(
            "A parameter as a multiple of a fitted one, e.g. k2=1.6*k1. Repeatable.",
            "Parameters that are a multiple of a fitted one: factor and name, or a text such as"
            ' ``"1.6*k1"``.',
            kind="Mapping of str to tuple of (float, str) or str, optional",
            metavar="NAME=FACTOR*NAME",
        ),
    ]
    noise: Annotated[
        _Assumed,
        Option(
            "Known standard deviation of an output, e.g. voltage=2mV; default estimated."
            " Repeatable.",
            "Known standard deviations of outputs, in the model's units or with a unit. Those of"
            " others are estimated from the residual.",
            kind="Mapping of str to float or str, optional",
            metavar="OUTPUT=DEVIATION",
        ),
    ]
    weights: Annotated[
        "Mapping[str, ArrayLike] | None",
        Option(
            doc="By output the weight of every sample of the only record, as a factor of its"
            " residual: one over its standard deviation, up to a common factor.",
            kind="Mapping of str to array_like, shape (n,), optional",
        ),
    ]
    loss: Annotated[
        str,
        Option(
            "How errors count: squares, student or cauchy (robust), or auto: by their tails.",
            "How errors count: as squares; as deviance of Student's t with 4 degrees of freedom, or"
            " of Cauchy's distribution, which outliers move little; or, ``auto``, as squares unless"
            " the tails of the residual are heavy.",
            default="auto",
            choices=("auto", "squares", "student", "cauchy"),
        ),
    ]
    starts: Annotated[
        Number,
        Option(
            "Points that a search begins at; default 1, and 5 if the residual is not white.",
            "Points at which a search begins; by default one, and five if the residual is not white"
            " then, so that a deeper minimum may exist.",
            least=1,
        ),
    ]
    interpolate: Annotated[
        bool,
        "Inputs are linear between samples; default constant.",
        "Whether inputs are linear between samples, or constant.",
    ]


class FitKeywords(
    MappingOption, SettingsOption, ToleranceOption, WorkersOption, AssumptionOptions, total=False
):
    """Keyword arguments of ``fit``."""


class CompareKeywords(
    FittedOption, MappingOption, SettingsOption, ToleranceOption, WorkersOption, total=False
):
    """Keyword arguments of ``compare``."""


# --- ageing --------------------------------------------------------------------------------------


class RiseOption(TypedDict, total=False):
    """The rise of the impedance at the end of a life."""

    rise: Annotated[
        float,
        PERCENT,
        Option(
            "Rise above the first value that ends the life, default 15%.",
            "Rise above the first value that ends the life, in percent.",
            default=15.0,
        ),
    ]


class AgeOptions(RiseOption, total=False):
    """Windows of an ageing record, the quantity that ends the life, and the derating."""

    fit: Annotated[
        Sequence[str],
        some_of("name the parameters, e.g. R1,R2,C"),
        Option(
            "Parameters of each window, default R1,R2,C,charge_start.",
            "Parameters that are fitted in each window, and start values of states.",
            default=("R1", "R2", "C", "charge_start"),
        ),
    ]
    of: Annotated[
        str,
        Option(
            "What rises: a ratio of two signals (default voltage/current) or a fitted parameter.",
            "The quantity whose rise ends the life: a ratio of two signals, of which the magnitude"
            " is computed from the fitted model, or a fitted parameter.",
            default="voltage/current",
            metavar="A/B|NAME",
        ),
    ]
    frequency: Annotated[
        float | str, RATE, Option("Frequency of the ratio, default 100mHz.", default=0.1)
    ]
    window: Annotated[float | str, TIME, Option("Length of a window, default 100s.", default=100.0)]
    derating: Annotated[
        Settings,
        "Parameter of the degradation estimator, e.g. initial_voltage_limit=1.2V. Repeatable.",
        "Parameters of the degradation estimator, as in `settings`.",
    ]


class AgeKeywords(MappingOption, SettingsOption, AgeOptions, ProgressOption, total=False):
    """Keyword arguments of ``age``."""


# --- frequency responses -------------------------------------------------------------------------


class ResponseOptions(TypedDict, total=False):
    """Estimated frequency responses: ratios, inputs, period, band."""

    of: Annotated[
        Sequence[str],
        RATIOS,
        "Ratio of two signals, e.g. voltage/current or force/displacement; default every output"
        " over every input that varies. Repeatable.",
        "Ratios of two signals, such as ``voltage/current`` or ``force/displacement``; by"
        " default every output over every input that varies. Required without a model.",
    ]
    inputs: Annotated[
        Names,
        Option(
            "Inputs, e.g. force; default the model's, or the denominators of the ratios.",
            "Signals that are inputs; by default those of the model, or without a model the"
            " denominators of the ratios.",
            metavar="COLUMNS",
        ),
    ]
    period: Annotated[
        Time,
        "Period of the inputs, e.g. 10s; default estimated from the record.",
        "Period of the inputs; by default estimated from the record.",
    ]
    band: Annotated[
        tuple[float, float] | None,
        BAND,
        "Frequencies to show, e.g. 10mHz..2Hz; default all of the record.",
        "Lowest and highest frequency; by default all of the record.",
    ]


class FrequencyKeywords(MappingOption, SettingsOption, UnitsOption, ResponseOptions, total=False):
    """Keyword arguments of ``frequency_response``."""


# --- black-box models ----------------------------------------------------------------------------


class StudyOptions(TypedDict, total=False):
    """Candidate models of a record, and the choice among them."""

    share: Annotated[
        float,
        Option(
            "Share of the record for estimation.",
            "Share of the record for estimation; the rest is for validation.",
            default=0.5,
        ),
    ]
    structures: Annotated[
        Names,
        Option(
            "Some of ARX, ARMAX, OE, SS (subspace), BJ (Box-Jenkins).",
            "Structures of Ljung; SS is a subspace method, BJ has a denominator for every input.",
            default=("ARX", "ARMAX", "OE", "SS", "BJ"),
            kind='sequence of {"ARX", "ARMAX", "OE", "SS", "BJ"}',
        ),
    ]
    path_orders: Annotated[
        Sequence[int],
        numbers(1),
        Option(
            "Orders of the path from every input, in all combinations; 50 at most.",
            "Orders of the path from every input, 50 at most, in all combinations with"
            " `noise_orders`.",
            default=(1, 2, 3),
        ),
    ]
    noise_orders: Annotated[
        Sequence[int],
        numbers(1),
        Option(
            "Orders of the noise model; 50 at most.",
            "Orders of the noise model, 50 at most.",
            default=(1, 2, 3),
        ),
    ]
    delays: Annotated[
        int | Sequence[int] | None,
        ONE_OR_ALL,
        Option(
            "Delays in samples: one number, or one for every input; default estimated, up to 100.",
            "Delays from every input to the output in samples; 0 for direct feedthrough. By default"
            " estimated, up to 100.",
        ),
    ]
    criterion: Annotated[
        str,
        Option(
            "Criterion for the orders: BIC or AIC.",
            "Criterion for the orders of each structure; among structures the simulation error on"
            " the rest of the record decides.",
            default="BIC",
            choices=("BIC", "AIC"),
        ),
    ]


class SamplePeriodOption(TypedDict, total=False):
    """Sample period of a file without time."""

    step: Annotated[
        Time,
        "Sample period of a file without time, such as 1s.",
        "Sample period of a file without time.",
    ]


class InputsOption(TypedDict, total=False):
    """Inputs of a black-box model."""

    inputs: Annotated[
        Names,
        Option(
            "Inputs; default all but the first column and the output.",
            "Columns; by default all but the first and the output.",
            metavar="COLUMNS",
        ),
    ]


class CountOption(TypedDict, total=False):
    """Reports of progress as counts."""

    progress: Annotated[
        Callable[[int, int], None],
        Option(
            doc="Called with the number of finished items and the number of all.",
            default=lambda done, whole: None,
        ),
    ]


class StudyKeywords(StudyOptions, CountOption, total=False):
    """Keyword arguments of a study of columns."""


class BlackBoxKeywords(SamplePeriodOption, StudyKeywords, total=False):
    """Keyword arguments of ``black_box``."""


# --- linear models -------------------------------------------------------------------------------


class LinearisePointOptions(TypedDict, total=False):
    """Operating point of a linearisation."""

    at: Annotated[
        Sequence[float | str],
        TIMES,
        "After a simulation of this time, e.g. 2s, or of several: 0s,1s,5s; default the start.",
        "Times of simulations that end at the operating points; by default the start. The"
        " search for an equilibrium begins there.",
    ]
    trim: Annotated[
        bool,
        "Linearise in an equilibrium, whose search begins at that time.",
        "Whether to linearise in an equilibrium: rates are zero, samples change nothing.",
    ]
    fix: Annotated[
        Settings,
        "Value of an input, state or output in the equilibrium, e.g. displacement=0.1mm."
        " Repeatable.",
        "Values of inputs, states and outputs in the equilibrium.",
    ]
    free: Annotated[
        Names,
        "Inputs and parameters that are solved for in the equilibrium, e.g. current.",
        "Inputs and parameters that are solved for in the equilibrium; for each of them a state"
        " or an output is fixed.",
    ]
    drift: Annotated[
        Names,
        "States with a constant rate in the equilibrium, e.g. maxwell_elongation.",
        "States with a constant rate in the equilibrium; all others are at rest.",
    ]


class ExchangeOption(TypedDict, total=False):
    """Communication step of a linear model."""

    step: Annotated[
        Time,
        "Communication step over which inputs and connections are constant.",
        "Communication step over which inputs and connections are constant, as with a Jacobi"
        " master; by default time is continuous. For an FMU that hides its states, the step of"
        " the pulses.",
    ]


class LineariseSignalOptions(ExchangeOption, total=False):
    """Inputs and outputs of a linear model, and its sample period."""

    inputs: Annotated[
        Names,
        "Inputs, or prescribed states; default all inputs.",
        "Inputs, or prescribed states, whose own laws are then not used; by default all inputs.",
    ]
    outputs: Annotated[
        Names,
        "Outputs, states, der(state), next(sampled state); default all outputs.",
        "Outputs, states, ``der(state)``, ``next(sampled state)``; by default all outputs.",
    ]
    cut: Annotated[
        str | None,
        Option(
            "Loop transfer function, cut at a state, or at a connection of a system, e.g."
            " bench.tension.",
            "Place at which a loop is cut for its transfer function: a state, or the input or"
            " output ``member.variable`` of a connection.",
            metavar="SIGNAL",
        ),
    ]


class LineariseOptions(SettingsOption, LinearisePointOptions, LineariseSignalOptions, total=False):
    """Options of ``linearise`` besides the model."""


class BandOptions(TypedDict, total=False):
    """Values of parameters for a band of linear models."""

    fitted: Annotated[
        File,
        "Parameters of a fit, and a band of them (ppy identify --json).",
        "Parameters of a fit, and a band drawn from their intervals: the file of"
        " ``ppy identify --json``.",
    ]
    samples: Annotated[
        Number,
        Option(
            "Models of a band, default 50.",
            "Number of models that are drawn for a band; by default 50. At most 10,000, as all of"
            " them are kept.",
            least=1,
            most=10_000,
        ),
    ]
    seed: Seed


class LineariseKeywords(LineariseOptions, BandOptions, PointsOption, total=False):
    """Keyword arguments of ``linearise``."""

    preset: Annotated[
        str | None, Option(doc="Name of a preset of the component, whose values are the start.")
    ]
    over: Annotated[
        "Mapping[str, str | Sequence[float]] | None",
        Option(
            doc="Family or band of parameters and constant inputs: values as in `sweep`, or ranges,"
            ' such as ``{"k1": "4e3..8e3"}``, in which values are drawn. Up to eight are shown one'
            " by one.",
            kind="Mapping of str to str or sequence of float, optional",
        ),
    ]


class ControllerOptions(TypedDict, total=False):
    """Signals between which a controller acts, and what the loop should do."""

    command: Annotated[
        str | None,
        Option(
            "Input of the model that the controller commands; default its only one.",
            metavar="INPUT",
        ),
    ]
    measured: Annotated[
        str | None,
        Option(
            "Output of the model that follows the reference; default its only one.",
            metavar="OUTPUT",
        ),
    ]
    controller: Annotated[
        str,
        Option(
            "Kind: pid, pi, state_feedback, adaptive, impedance, or of an installed package.",
            "Kind of controller: ``pid``, ``pi``, ``state_feedback``, ``adaptive``, ``impedance``,"
            " or one of an installed package.",
            default="pid",
            metavar="KIND",
        ),
    ]
    controller_settings: Annotated[
        Settings,
        "Set a parameter of the controller, e.g. stiffness=2N/mm. Repeatable.",
        "Values of parameters of the controller, in place of those of the design.",
    ]
    sample_period: Annotated[
        Time, "Sample period of the controller; default that of a sampled model."
    ]
    phase_margin: Annotated[
        float | None,
        Option(
            "Phase margin of the loop of a pid or pi, degrees; default 60 with a crossover, else"
            " the one from 60 on that suppresses loads best.",
            metavar="DEGREES",
            least=1,
            most=179,
        ),
    ]
    crossover: Annotated[
        Rate,
        Option(
            "Frequency of gain one, about the bandwidth; default the one that suppresses loads"
            " best.",
            metavar="FREQUENCY",
        ),
    ]
    delay: Annotated[
        float | str,
        TIME,
        Option("Dead time of the loop that the model does not have.", default=0.0),
    ]
    limits: Annotated[
        "tuple[float, float] | str | None",
        LIMITS,
        "Lowest and highest command, e.g. -1.3A..1.3A; default none.",
        "Lowest and highest command.",
    ]


class DesignOptions(
    ControllerOptions, ExchangeOption, SettingsOption, LinearisePointOptions, total=False
):
    """Options of ``design`` besides the model."""


class DesignKeywords(DesignOptions, BandOptions, total=False):
    """Keyword arguments of ``design``."""

    over: Annotated[
        "Mapping[str, str | Sequence[float]] | None",
        Option(
            doc='Band of parameters, as of `linearise`: ``{"k1": "4e3..8e3"}``.',
            kind="Mapping of str to str or sequence of float, optional",
        ),
    ]


# --- sweeps --------------------------------------------------------------------------------------


class SweepDesignOptions(OutputsOption, total=False):
    """Cases of a sweep, and the reductions that are kept."""

    kind: Annotated[
        str,
        Option(
            "grid, list (first values together, then second ones), draws (a list drawn at random:"
            " bands), latin-hypercube, sobol; sobol-indices, tornado: which parameters matter.",
            "Design of the cases. `sensitivity` and `tornado` evaluate the last two, and `bands`"
            " cases that were drawn at random, such as those of ``fit(...).draws(200)``.",
            default="grid",
            choices=(
                "grid",
                "list",
                "draws",
                "latin-hypercube",
                "sobol",
                "sobol-indices",
                "tornado",
            ),
        ),
    ]
    samples: Annotated[
        Number,
        "Number of cases N of latin-hypercube and sobol; sobol-indices has N (parameters + 2).",
        "Number of cases N of a design that chooses values; ``sobol-indices`` has N for each"
        " parameter and 2 N besides.",
    ]
    seed: Seed
    keep: Annotated[
        Sequence[str] | None,
        NAMES,
        "Reductions of each output: last,smallest,largest by default, mean, rms, trace (all"
        " points, the default with --fitted).",
        "Reductions of each output: ``last``, ``smallest``, ``largest``, which are the default,"
        " ``mean``, ``rms``, or ``trace`` for all points.",
    ]


class SweepEngineOptions(TypedDict, total=False):
    """Engine that runs the cases of a sweep, and its processes."""

    engine: Annotated[
        str,
        Option(
            "auto, fmu, or compiled: the equations of a component, faster, same numbers.",
            "Engine of the cases: the FMU, or the compiled equations of a component, which are"
            " faster with the same numbers; ``auto`` uses these wherever possible.",
            default="auto",
            choices=("auto", "fmu", "compiled"),
        ),
    ]
    workers: Annotated[
        int,
        Option(
            "Processes that run cases.",
            "Processes, at most 1000 and at most the number of cases.",
            default=1,
            metavar="N",
        ),
    ]
    scheduler: Annotated[
        str | None,
        Option(
            "Run on a Dask cluster, such as tcp://10.0.0.5:8786.",
            'Address of a Dask cluster that runs the cases, such as ``"tcp://10.0.0.5:8786"``.',
            metavar="ADDRESS",
        ),
    ]


class SweepFileKeywords(SweepEngineOptions, CountOption, total=False):
    """Keyword arguments of ``sweep_file`` besides its ``note``."""

    folder: Annotated[
        str | Path | None,
        Option(
            doc="Folder that keeps finished cases, so that the same call resumes after an"
            " interrupt; it is not deleted. Traces are read from there when they are used, so that"
            " they need not fit into memory."
        ),
    ]
    isolate: Annotated[
        bool | None,
        Option(
            doc="Run the FMU in other processes, so that only its case fails if it crashes or"
            " hangs. None: isolate FMUs from files.",
            default=False,
        ),
    ]
    limits: Annotated[
        "Limits | None",
        Option(doc="Limits of such a process; by default the usual ones.", kind="Limits, optional"),
    ]
    check: Annotated[
        "Callable[[Task, Design], None]",
        Option(
            doc="Called with the task and its cases before the first run; an error ends the sweep.",
            default=lambda task, cases: None,
            kind="callable",
        ),
    ]


class SweepKeywords(
    PointsOption,
    GridOptions,
    SettingsOption,
    ToleranceOption,
    SweepDesignOptions,
    SweepFileKeywords,
    total=False,
):
    """Keyword arguments of ``sweep``."""


class OptimiseOptions(TypedDict, total=False):
    """Objectives of an optimisation, and the effort of its search."""

    maximise: Annotated[
        Names,
        "Outputs to maximise, one or two with --minimise; 'a & b' is the worse of two. One"
        " objective gives the best point, two a Pareto front.",
        'Outputs that are maximised at the end of the run; ``"a & b"`` is the worse of two. One'
        " objective, with those of `minimise`, gives the best point, two a Pareto front.",
    ]
    minimise: Annotated[
        Names, "Outputs to minimise; 'a & b' is the worse of two.", "Outputs that are minimised."
    ]
    levels: Annotated[
        int,
        Option(
            "Points of the front.",
            "Levels of the second objective at which the first is optimised.",
            default=21,
            least=2,
            most=10_000,
            metavar="N",
        ),
    ]
    starts: Annotated[
        int,
        Option(
            "Start points of a Sobol sequence, a power of 2.",
            "Start points of the search from a Sobol sequence, a power of 2.",
            default=256,
            least=16,
            most=2**20,
            metavar="N",
        ),
    ]
    seed: Seed


class OptimiseKeywords(
    PointsOption, GridOptions, SettingsOption, OptimiseOptions, CountOption, total=False
):
    """Keyword arguments of ``optimise``."""

    folder: Annotated[
        str | Path | None,
        Option(
            doc="Folder that keeps every finished point, so that the same call resumes after an"
            " interrupt; it is not deleted."
        ),
    ]


class NoteOption(TypedDict, total=False):
    """Remarks on a file."""

    note: Annotated[
        Callable[[str], None],
        Option(
            doc="Called with each remark, such as on inputs that stay at their start value.",
            default=lambda line: None,
        ),
    ]
