"""Options of the functions of ``import ppy_rig as ppy`` that the command line takes, too.

Nothing heavy is imported here, for ``ppy COMMAND --help`` reads this module; types that would need
it stand in quotes. With ``from __future__ import annotations`` all of them would, and the options
beside them could not be read.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

from orchestration.api.declaration import Form, Option
from orchestration.api.forms import (
    BAND,
    EFFECTS,
    LEFT_OUT,
    MAPPING,
    NAMES,
    ONE_OR_ALL,
    RATIOS,
    RECORDS,
    SETTINGS,
    TIME,
    TIMES,
    numbers,
    some_of,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from orchestration.api.records import Records
    from orchestration.fmu.isolation import Limits
    from orchestration.records import Record
    from orchestration.sweeps import Design, Task


# --- what several functions take -----------------------------------------------------------------


class MappingOption(TypedDict, total=False):
    """The columns of a file that have other names than the model's signals."""

    mapping: Annotated[
        Mapping[str, str] | None,
        Option(
            "Which column is which signal, e.g. U_cell=voltage or stress=force[N]. Repeatable.",
            'Column of a file to signal of the model, such as ``{"stress": "force[N]"}``, for'
            " records that are given as files.",
            metavar="COLUMN=SIGNAL[UNIT]",
            form=MAPPING,
        ),
    ]


class SettingsOption(TypedDict, total=False):
    """The values that a model starts from."""

    settings: Annotated[
        Mapping[str, float | str] | None,
        Option(
            "Set a parameter, e.g. R1=0.61 or k1=6.3N/mm. Repeatable.",
            "Values of parameters, which a fit starts from, and of inputs that stay at a value:"
            ' numbers in the model\'s units, or texts with a unit such as ``"6.3 N/mm"``.',
            metavar="NAME=VALUE[UNIT]",
            form=SETTINGS,
        ),
    ]


class RecordOptions(MappingOption, total=False):
    """The records of a diagnosis: their columns, what they have in common, which of them judge."""

    runs: Annotated[
        str | None,
        Option(
            "Column that tells the records in a file apart; else a clock that restarts.",
            "Column of a file that tells its records apart, and labels them.",
            metavar="COLUMN",
        ),
    ]
    each: Annotated[
        Sequence[str],
        Option(
            "Parameters that differ from record to record, e.g. ocv,R0.",
            "Parameters that differ from record to record.",
            default=(),
            form=NAMES,
        ),
    ]
    holdout: Annotated[
        "Records | None",
        Option(
            "A record to judge by, or labels such as 7,8,9 of some of several; default the last"
            " third. Repeatable.",
            "Other records to judge by, or some of those given by their labels, such as"
            ' ``"7,8,9"``. Without it the last third of the record is held out, or the last third'
            " of several records.",
            kind="Record, str or Path, or sequence of these, optional",
            metavar="RECORD",
            form=RECORDS,
        ),
    ]
    interpolate: Annotated[
        bool | None,
        Option(
            "Inputs go smoothly between samples, or are held; default what the record tells.",
            "Whether inputs go smoothly between samples, or are held; unless given, the record"
            " tells.",
            flag="--interpolate/--no-interpolate",
        ),
    ]


class SearchOptions(SettingsOption, total=False):
    """The search for a cause: where it starts, what it leaves alone, how long it takes."""

    hold: Annotated[
        Sequence[str],
        Option(
            "Parameters that are known and not fitted, e.g. mass,R1; see --set.",
            "Parameters that are known and not fitted.",
            default=(),
            form=NAMES,
        ),
    ]
    time: Annotated[
        float | str | None,
        Option(
            "Processor time of each search, e.g. 60s or inf; then the best answer so far. Default"
            " 60 s for 60,000 samples or less, and in proportion beyond.",
            "Processor time that the search may take, then the best answer so far is returned, with"
            " a note; a minute for up to 60,000 samples and in proportion beyond, unless given. A"
            " busy machine gives the same answer, and with ``inf`` nothing hangs on how fast the"
            " machine is. With a later record to compare it holds for each of three searches.",
            kind='float in s or str such as "10s", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]


class ProgressOption(TypedDict, total=False):
    """The words on how far the work is."""

    progress: Annotated[
        Callable[[str], None],
        Option(doc="Told what is being done.", default=lambda text: None),
    ]


# --- diagnose and laws ---------------------------------------------------------------------------


class DiagnoseOptions(RecordOptions, SearchOptions, total=False):
    """Options of ``diagnose``, beside the record and the model."""

    effects: Annotated[
        Sequence[str] | None,
        Option(
            "Only these, e.g. diffusion,sensor_lag(voltage); none only recalibrates; families: all"
            " that is known and what fits the model's laws by their units, e.g. dead_zone(voltage),"
            " the default where its file lists none.",
            "Only these, as ``id`` or ``id(output)``; an empty one only recalibrates."
            ' ``["families"]`` is all that is known and what fits the model\'s laws by their units,'
            " which is the default where a model's file lists no effects.",
            form=EFFECTS,
            complete="effect",
        ),
    ]
    fit: Annotated[
        Sequence[str],
        Option(
            "Parameters of an FMU without equations that are fitted too, e.g. p1,p2.",
            "Parameters of an FMU without equations, which is diagnosed from outside: effects of"
            " measurement on its outputs, and corrections of these by any of its signals.",
            default=(),
            form=NAMES,
        ),
    ]
    compare: Annotated[
        "Record | str | Path | None",
        Option(
            "A later record of the specimen: what changed in it.",
            "A later record of the same specimen: `DiagnosisResult.changes` then tells which"
            " parameters changed, and which effects came or went.",
            kind="Record, str or Path, optional",
            metavar="AFTER",
            form=Form(typed=Path | None),
        ),
    ]
    laws: Annotated[
        bool,
        Option(
            "Leave out asking every law of the model what it lacks, where something is left.",
            "Whether, where something is left that neither parameters nor effects account for,"
            " every law is asked what it lacks (`laws`). What unseen data confirm of it is a"
            " cause.",
            default=True,
            flag="--no-laws",
            form=LEFT_OUT,
        ),
    ]


class LawsOptions(RecordOptions, SearchOptions, total=False):
    """Options of ``laws``, beside the record and the model."""

    effects: Annotated[
        Sequence[str] | None,
        Option(
            "Looked for before the laws are asked, and part of the model then if named, e.g."
            " diffusion; families is all that is known; default none.",
            "Looked for before the laws are asked, as in `diagnose`; what is named there is part of"
            " the model that is asked. None unless given.",
            default=(),
            form=EFFECTS,
            complete="effect",
        ),
    ]


class DiagnoseKeywords(DiagnoseOptions, ProgressOption, total=False):
    """Keyword arguments of ``diagnose``."""


class LawsKeywords(LawsOptions, ProgressOption, total=False):
    """Keyword arguments of ``laws``."""


# --- simulate and run ----------------------------------------------------------------------------

_TIMES = "such as 30s, 10ms or 2min, plain numbers in s; default the record's, else the FMU's own."


class GridOptions(TypedDict, total=False):
    """The points in time of a simulation, where no record has them."""

    stop: Annotated[
        float | str | None,
        Option(
            f"Stop time, {_TIMES}",
            "Last point; the FMU's own unless given.",
            kind='float in s or str such as "10s", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]
    step: Annotated[
        float | str | None,
        Option(
            f"Communication step, {_TIMES}",
            "From point to point; the FMU's own unless given.",
            kind='float in s or str such as "10s", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]


class PointsOption(TypedDict, total=False):
    """The points in time themselves."""

    time: Annotated[
        "ArrayLike | None",
        Option(
            doc="Points, s; else a grid to `stop` by `step`, by default the FMU's own experiment,"
            " from the start time that it declares, else zero.",
            kind="array_like, shape (n,), optional",
        ),
    ]


class IsolateKeyword(TypedDict, total=False):
    """A process of its own for one run of an FMU."""

    isolate: Annotated[
        "bool | Limits",
        Option(
            doc="Run it in a process of its own, which an FMU may end or hang in without harm; with"
            " other limits than usual.",
            default=False,
            kind="bool or Limits",
        ),
    ]


class SimulateKeywords(PointsOption, GridOptions, SettingsOption, IsolateKeyword, total=False):
    """Keyword arguments of ``simulate``."""


class RunKeywords(IsolateKeyword, total=False):
    """Keyword arguments of ``run`` for an experiment."""

    settings: Annotated[
        Mapping[str, object] | None,
        Option(
            doc="Of an experiment: what replaces values of its file, such as"
            ' ``{"duration": "20 s", "R1": "610 mohm"}``.'
        ),
    ]
    folder: Annotated[
        str | Path | None,
        Option(
            doc="Of an experiment with variants: keeps each that is done, so that the same call"
            " goes on after an interrupt; it stays."
        ),
    ]


# --- build ---------------------------------------------------------------------------------------


class BuildKeywords(TypedDict, total=False):
    """Keyword arguments of ``build``."""

    runtime: Annotated[
        str,
        Option(
            doc="Compiled from C, laws interpreted by Python, or a stock archive of pythonfmu,"
            " which promises less.",
            default="native",
            choices=("native", "python", "pythonfmu"),
        ),
    ]
    effects: Annotated[
        Sequence[str],
        Option(doc="Effects of the catalogue to lay over it.", default=(), form=NAMES),
    ]
    platforms: Annotated[
        Sequence[str] | None, Option(doc="FMI platforms; default this machine's.", form=NAMES)
    ]
    fmi: Annotated[int, Option(doc="Version of FMI, 2 or 3; 3 is native.", default=2)]


# --- compare and fit -----------------------------------------------------------------------------


class WorkersOption(TypedDict, total=False):
    """The processes of a fit."""

    workers: Annotated[
        int,
        Option(
            "Processes that run an FMU without equations.",
            "Processes that run an FMU without equations side by side in a fit.",
            default=1,
            metavar="N",
            least=1,
        ),
    ]


class FittedOption(TypedDict, total=False):
    """The parameters that a comparison fits first."""

    fit: Annotated[
        Sequence[str],
        Option(
            "Parameters to recalibrate, e.g. R1,R2,C.",
            "Parameters to recalibrate first.",
            default=(),
            form=some_of("name the parameters to recalibrate, e.g. R1,R2,C"),
        ),
    ]


class FitKeywords(MappingOption, SettingsOption, WorkersOption, total=False):
    """Keyword arguments of ``fit``."""


class CompareKeywords(FittedOption, FitKeywords, total=False):
    """Keyword arguments of ``compare``."""


# --- frequency responses -------------------------------------------------------------------------


class ResponseOptions(TypedDict, total=False):
    """The responses that are estimated: of what, to what, at which frequencies."""

    of: Annotated[
        Sequence[str],
        Option(
            "Ratio of two signals, e.g. voltage/current or force/displacement; default every output"
            " over every input that varies. Repeatable.",
            "Ratios of two signals, such as ``voltage/current`` or ``force/displacement``; every"
            " output over every input that varies unless given. Needed without a model.",
            default=(),
            metavar="A/B",
            form=RATIOS,
        ),
    ]
    inputs: Annotated[
        Sequence[str],
        Option(
            "What drives, e.g. force; default the model's inputs, or what the ratios are over.",
            "Signals that drive the others; the model's inputs unless given, or without a model"
            " those that ratios are over.",
            default=(),
            metavar="COLUMNS",
            form=NAMES,
        ),
    ]
    period: Annotated[
        float | str | None,
        Option(
            "Period of the inputs, e.g. 10s; default found in the record.",
            "Period of the inputs; found in the record unless given.",
            kind='float in s or str such as "10s", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]
    band: Annotated[
        tuple[float, float] | None,
        Option(
            "Frequencies to show, e.g. 10mHz..2Hz; default all that the record has.",
            "Lowest and highest frequency; all that the record has unless given.",
            kind='tuple of float in Hz or str such as "10mHz..2Hz", optional',
            metavar="FROM..TO",
            form=BAND,
        ),
    ]


class FrequencyKeywords(MappingOption, SettingsOption, ResponseOptions, total=False):
    """Keyword arguments of ``frequency_response``."""


# --- black-box models ----------------------------------------------------------------------------


class StudyOptions(TypedDict, total=False):
    """The models that are tried on a record, and what chooses among them."""

    share: Annotated[
        float,
        Option(
            "Of the record that models are identified from.",
            "Of the record that models are identified from; the rest judges them.",
            default=0.5,
        ),
    ]
    structures: Annotated[
        Sequence[str],
        Option(
            "Of ARX, ARMAX, OE, SS (subspace), BJ (Box-Jenkins).",
            "Ljung's; SS is a subspace method, BJ has a denominator of its own for every input.",
            default=("ARX", "ARMAX", "OE", "SS", "BJ"),
            kind='sequence of {"ARX", "ARMAX", "OE", "SS", "BJ"}',
            form=NAMES,
        ),
    ]
    path_orders: Annotated[
        Sequence[int],
        Option(
            "Of the path from every input, all combinations; 50 at most.",
            "Orders of the path from every input, 50 at most; every combination with `noise_orders`"
            " is tried.",
            default=(1, 2, 3),
            form=numbers(1),
        ),
    ]
    noise_orders: Annotated[
        Sequence[int],
        Option(
            "Of the noise model; 50 at most.",
            "Orders of the noise model, 50 at most.",
            default=(1, 2, 3),
            form=numbers(1),
        ),
    ]
    delays: Annotated[
        int | Sequence[int],
        Option(
            "In samples: one number, or one for every input.",
            "From every input to the output, in samples; 0 where the output answers in the same"
            " sample.",
            default=1,
            form=ONE_OR_ALL,
        ),
    ]
    criterion: Annotated[
        str,
        Option(
            "What chooses the orders: BIC or AIC.",
            "What chooses the orders of every structure; the free run over the rest of the record"
            " chooses among structures.",
            default="BIC",
            choices=("BIC", "AIC"),
        ),
    ]


class SamplePeriodOption(TypedDict, total=False):
    """The sample period of a file that has no time."""

    step: Annotated[
        float | str | None,
        Option(
            "Sample period of a file without time, such as 1s.",
            "Sample period of a file that has no time.",
            kind='float in s or str such as "10s", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]


class InputsOption(TypedDict, total=False):
    """The columns that drive a black-box model."""

    inputs: Annotated[
        Sequence[str],
        Option(
            "What drives it; all but the first unless named.",
            "Columns; all but the first and the output unless given.",
            default=(),
            metavar="COLUMNS",
            form=NAMES,
        ),
    ]


class CountOption(TypedDict, total=False):
    """The count of what is done."""

    progress: Annotated[
        Callable[[int, int], None],
        Option(
            doc="Told how many are done, and of how many.",
            default=lambda done, whole: None,
        ),
    ]


class StudyKeywords(StudyOptions, CountOption, total=False):
    """Keyword arguments of a study of columns."""


class BlackBoxKeywords(SamplePeriodOption, StudyKeywords, total=False):
    """Keyword arguments of ``black_box``."""


# --- linear models -------------------------------------------------------------------------------


class LinearisePointOptions(TypedDict, total=False):
    """The operating point about which a model is linearised."""

    at: Annotated[
        Sequence[float | str],
        Option(
            "After a simulation of this time, e.g. 2s, or of several: 0s,1s,5s; default the start.",
            "Times of simulations that end at the operating points; the start unless given. An"
            " equilibrium is searched from there.",
            default=(),
            kind='float in s or str such as "10s", or sequence of these',
            metavar="TIMES",
            form=TIMES,
        ),
    ]
    trim: Annotated[
        bool,
        Option(
            "In an equilibrium, which is searched from there.",
            "Whether to linearise in an equilibrium: rates are zero, samples change nothing.",
            default=False,
        ),
    ]
    fix: Annotated[
        Mapping[str, float | str] | None,
        Option(
            "Of an equilibrium: value of an input, state or output, e.g. displacement=0.1mm."
            " Repeatable.",
            "Of an equilibrium: values of inputs, states and outputs.",
            metavar="NAME=VALUE[UNIT]",
            form=SETTINGS,
        ),
    ]
    free: Annotated[
        Sequence[str],
        Option(
            "Of an equilibrium: inputs and parameters that take the value it needs, e.g. current.",
            "Of an equilibrium: inputs and parameters that take the value that it needs; for each"
            " of these a state or an output is fixed.",
            default=(),
            form=NAMES,
        ),
    ]
    drift: Annotated[
        Sequence[str],
        Option(
            "Of an equilibrium: states that may move at a constant rate, e.g. maxwell_elongation.",
            "Of an equilibrium: states that may move at a constant rate, all others being at rest.",
            default=(),
            form=NAMES,
        ),
    ]


class LineariseSignalOptions(TypedDict, total=False):
    """The signals between which a model is linear, and the time that it is discrete in."""

    inputs: Annotated[
        Sequence[str],
        Option(
            "Inputs, or states that are prescribed; all inputs unless named.",
            "Inputs, or states that are prescribed, whose own laws do not count then; all inputs"
            " unless given.",
            default=(),
            form=NAMES,
        ),
    ]
    outputs: Annotated[
        Sequence[str],
        Option(
            "Outputs, states, der(state), next(sampled state); all outputs unless named.",
            "Outputs, states, ``der(state)``, ``next(sampled state)``; all outputs unless given.",
            default=(),
            form=NAMES,
        ),
    ]
    cut: Annotated[
        str | None,
        Option(
            "Loop transfer function: cut at a state, or at a connection of a system, e.g."
            " bench.tension.",
            "The loop transfer function of the loop that is cut here: at a state, or at the input"
            " or output ``member.variable`` of a connection.",
            metavar="SIGNAL",
        ),
    ]
    step: Annotated[
        float | str | None,
        Option(
            "Communication step over which inputs and connections are held.",
            "Communication step over which inputs and connections are held, as a master by Jacobi's"
            " method does; continuous unless given. Of an FMU that hides its states: that of the"
            " pulses.",
            kind='float in s or str such as "10ms", optional',
            metavar="TIME",
            form=TIME,
        ),
    ]


class LineariseOptions(SettingsOption, LinearisePointOptions, LineariseSignalOptions, total=False):
    """Options of ``linearise``, beside the model."""


class BandOptions(TypedDict, total=False):
    """The values of parameters that make a band."""

    fitted: Annotated[
        Path | None,
        Option(
            "Band of parameters drawn from a fit (ppy identify --json).",
            "Band of parameters drawn from a fit: the file of ``ppy identify --json``.",
            kind="str or Path, optional",
            metavar="FILE",
        ),
    ]
    samples: Annotated[
        int | None,
        Option(
            "How many are drawn, default 50.",
            "Values that are drawn for a band; 50 unless given. At most 10,000: all of the linear"
            " models are kept.",
            metavar="N",
            least=1,
            most=10_000,
        ),
    ]
    seed: Annotated[int, Option("Of what is drawn.", default=0, least=0)]


class LineariseKeywords(LineariseOptions, BandOptions, PointsOption, total=False):
    """Keyword arguments of ``linearise``."""

    preset: Annotated[
        str | None, Option(doc="Name of one of the component's presets to start from.")
    ]
    over: Annotated[
        "Mapping[str, str | Sequence[float]] | None",
        Option(
            doc='Band of parameters: ``{"k1": "4e3..8e3"}``, drawn between these; or values, as'
            " in `sweep`.",
            kind="Mapping of str to str or sequence of float, optional",
        ),
    ]


# --- sweeps --------------------------------------------------------------------------------------


class SweepDesignOptions(TypedDict, total=False):
    """The cases of a sweep, and what is kept of each."""

    kind: Annotated[
        str,
        Option(
            "grid, list (first values together, then second ones), draws (a list drawn at random:"
            " bands), latin-hypercube, sobol; sobol-indices, tornado: which parameters matter.",
            "Design; `sensitivity` and `tornado` tell what the last two come to, and `bands` what"
            " cases come to that were drawn at random, such as those of ``fit(...).draws(200)``.",
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
        int | None,
        Option(
            "Cases of latin-hypercube and sobol; of sobol-indices for each parameter, and twice as"
            " many.",
            "Cases of a design that chooses values; of ``sobol-indices`` as many for each"
            " parameter, and twice as many besides.",
            metavar="N",
        ),
    ]
    seed: Annotated[int, Option("Of what is chosen at random.", default=0, least=0)]
    outputs: Annotated[
        Sequence[str],
        Option(
            "Which outputs are kept, e.g. voltage,charge.",
            "Outputs that are kept; all unless given.",
            default=(),
            form=NAMES,
        ),
    ]
    keep: Annotated[
        Sequence[str] | None,
        Option(
            "What of each: last,smallest,largest as a rule, mean, rms, trace (all of it; of"
            " --fitted).",
            "Of each output: ``last``, ``smallest``, ``largest``, which are kept unless given,"
            " ``mean``, ``rms``, or ``trace`` for its whole course.",
            form=NAMES,
        ),
    ]


class SweepEngineOptions(TypedDict, total=False):
    """The engine that runs the cases of a sweep, and its processes."""

    engine: Annotated[
        str,
        Option(
            "auto, fmu, or compiled: the equations of a component, faster, same numbers.",
            "What runs the cases: the FMU, or the equations of a component in compiled code, which"
            " comes to the same numbers sooner and is the choice of ``auto`` wherever it is"
            " possible.",
            default="auto",
            choices=("auto", "fmu", "compiled"),
        ),
    ]
    workers: Annotated[
        int,
        Option(
            "Processes that run cases.",
            "Processes, 1000 at most; never more than there are cases.",
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
    """Keyword arguments of ``sweep_file``, beside its ``note``."""

    folder: Annotated[
        str | Path | None,
        Option(
            doc="Keeps what is done, so that the same call goes on after an interrupt; it stays."
            " Traces are read from there when they are used, so that they need not fit into"
            " memory."
        ),
    ]
    isolate: Annotated[
        bool | None,
        Option(
            doc="Run the FMU in processes of their own, which it may end or hang in: that case"
            " fails, and the others go on. None: if it is a file that somebody gave.",
            default=False,
        ),
    ]
    limits: Annotated[
        "Limits | None",
        Option(doc="Of such a process; the usual ones unless given.", kind="Limits, optional"),
    ]
    check: Annotated[
        "Callable[[Task, Design], None]",
        Option(
            doc="Told what is going to be run before anything is; what it raises ends the sweep.",
            default=lambda task, cases: None,
            kind="callable",
        ),
    ]


class SweepKeywords(
    PointsOption, GridOptions, SettingsOption, SweepDesignOptions, SweepFileKeywords, total=False
):
    """Keyword arguments of ``sweep``."""


class OptimiseOptions(TypedDict, total=False):
    """The objectives of an optimisation, and how finely and long is searched."""

    maximise: Annotated[
        Sequence[str],
        Option(
            "Outputs to make large, one or two with --minimise; 'a & b' is the worse of two. One"
            " gives the best, two a Pareto front.",
            'Outputs that are made large, at the end of the run; ``"a & b"`` is the worse of two.'
            " One objective, with those of `minimise`, gives the best, two a Pareto front.",
            default=(),
            form=NAMES,
        ),
    ]
    minimise: Annotated[
        Sequence[str],
        Option(
            "Outputs to make small; 'a & b' is the worse of two.",
            "Outputs that are made small.",
            default=(),
            form=NAMES,
        ),
    ]
    levels: Annotated[
        int,
        Option(
            "Points of the front that are searched.",
            "Levels of the second objective at which the best of the first is searched.",
            default=21,
            least=2,
            most=10_000,
            metavar="N",
        ),
    ]
    starts: Annotated[
        int,
        Option(
            "Sobol points from which is searched, a power of 2.",
            "Points of a Sobol sequence from which the search starts, a power of 2.",
            default=256,
            least=16,
            most=2**20,
            metavar="N",
        ),
    ]
    seed: Annotated[int, Option("Of what is chosen at random.", default=0, least=0)]


class OptimiseKeywords(
    PointsOption, GridOptions, SettingsOption, OptimiseOptions, CountOption, total=False
):
    """Keyword arguments of ``optimise``."""

    folder: Annotated[
        str | Path | None,
        Option(
            doc="Keeps every point that was searched, so that the same call goes on after an"
            " interrupt; it stays."
        ),
    ]


class NoteOption(TypedDict, total=False):
    """The words on what a file leaves open."""

    note: Annotated[
        Callable[[str], None],
        Option(
            doc="Told what else is worth knowing, such as inputs that stay at their start value.",
            default=lambda line: None,
        ),
    ]
