"""Claims: whatever is wrong in an experiment, one line says where and what is allowed, and earlier
results stay.
"""

import shutil

import pytest

from fmus import component
from orchestration import master
from orchestration.fmu.model import find_model
from orchestration.system import Member, Port, System, ssp
from studies.emulator.emulator import EmulatedRig
from tests.support.command import here, measure, refused

FUSED = 'system = "dma_bench"\nmaster = {method = "fused"'
GOOD = """
component = "ppy_actuator"
duration = "2 s"
step = 0.1
record = ["voltage"]
[inputs]
force = "1 N"
[inputs.current]
kind = "square"
amplitude = "0.9 A"
frequency = "0.5 Hz"
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with a good experiment, a record and earlier results."""
    (tmp_path / "good.toml").write_text(GOOD, encoding="utf-8")
    measure(tmp_path / "record.csv", EmulatedRig(seed=1), 40)
    for name in ("out.nc", "out.csv", "out.png", "out.html"):
        (tmp_path / name).write_text("the result of earlier work\n", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("[inputs]", "[inputs", ["line 6", "column"]),
        ("[inputs]", "[inputs]\nforce = 2", ["overwrite", "line"]),
        ("ppy_actuator", "ppy_actuater", ["'ppy_actuater'", "did you mean ppy_actuator?"]),
        ("ppy_actuator", "other.fmu", ["other.fmu", "no such file"]),
        ('component = "ppy_actuator"', "", ["a component or a system, one of them"]),
        ('component = "ppy_actuator"', 'component = "a"\nsystem = "b"', ["one of them"]),
        (
            'component = "ppy_actuator"',
            'system = "dma_bensh"',
            ["'dma_bensh'", "did you mean dma_bench?"],
        ),
        ('component = "ppy_actuator"', 'system = "other.ssp"', ["other.ssp"]),
        (
            "component =",
            'master = {method = "jacobi"}\ncomponent =',
            ["master is for a system", "on a component"],
        ),
        (
            "component =",
            'preset = "six_layer"\ncomponent =',
            ["no preset named 'six_layer'", "five_layer"],
        ),
        (
            "component =",
            'effects = ["quadratic_strian"]\ncomponent =',
            ["'quadratic_strian'", "quadratic_strain?"],
        ),
        (
            'component = "ppy_actuator"',
            'system = "dma_bench"\nmaster = {method = "fussed"}',
            ["'jacobi' or 'fused'"],
        ),
        (
            'component = "ppy_actuator"',
            f"{FUSED}, rates = {{bench = 2}}}}",
            ["rates", "a fused system has none"],
        ),
        (
            'component = "ppy_actuator"',
            f"{FUSED}, extrapolation = 1}}",
            ["extrapolation", "a fused system has none"],
        ),
        (
            'component = "ppy_actuator"',
            f'runtime = "python"\n{FUSED}}}',
            ["runtime = 'python'", "compiled"],
        ),
        (
            "component =",
            'runtime = "fortran"\ncomponent =',
            ["runtime = 'fortran'", "'native' or 'python'"],
        ),
        ("component =", "seed = -1\ncomponent =", ["seed = -1", "greater than or equal to 0"]),
        ("component =", "seed = 1.5\ncomponent =", ["seed = 1.5", "valid integer"]),
        ("duration", "durration", ["unknown key 'durration'", "did you mean duration?"]),
        ('"2 s"', '"2 V"', ["duration = '2 V'", "'V'", "'s'"]),
        ('"2 s"', "-2", ["duration = -2", "above 0"]),
        ('"2 s"', "inf", ["duration = inf", "finite number"]),
        ('"2 s"', "true", ["duration = True", "finite number"]),
        ('"2 s"', '"two seconds"', ["duration = 'two seconds'", "finite number", "'500 mA'"]),
        ('"2 s"', '"2 wexs"', ["duration = '2 wexs'", "unknown unit 'wexs'"]),
        ('"2 s"', "1e9", ["at most 1e7"]),
        ("step = 0.1", "step = 0", ["step = 0", "above 0"]),
        ("step = 0.1", "step = 1979-05-27", ["step = datetime.date(1979, 5, 27)", "finite number"]),
        ('["voltage"]', '"voltage"', ["record = 'voltage'", "valid list"]),
        ('["voltage"]', '["voltagge"]', ["record", "'voltagge'", "did you mean voltage?"]),
        ('["voltage"]', '["R1"]', ["record", "'R1'"]),
        ('"1 N"', '"1 mm"', ["inputs.force", "value = 1 mm", "'mm'", "'N'"]),
        ('"1 N"', "[1]", ["inputs.force.value = [1]", "finite number"]),
        ("force =", "forse =", ["no input named 'forse'", "did you mean force?"]),
        ('kind = "square"\n', "", ["inputs.current.kind is missing"]),
        ('"square"', '"squaer"', ["inputs.current.kind = 'squaer'", "did you mean square?"]),
        (
            "amplitude",
            "amplitud",
            ["inputs.current", "unknown key 'amplitud'", "did you mean amplitude?"],
        ),
        ('amplitude = "0.9 A"\n', "", ["inputs.current.amplitude is missing"]),
        ('"0.9 A"', '"0.9 V"', ["inputs.current", "amplitude = 0.9 V", "'A'"]),
        ('"0.5 Hz"', "0", ["inputs.current.frequency = 0", "above 0"]),
        ('"0.5 Hz"', '"3 rad/s"', ["inputs.current.frequency = '3 rad/s'", "'Hz'"]),
        (
            "[inputs]",
            "[parameters]\nR9 = 1\n[inputs]",
            ["no parameter named 'R9'", "did you mean R"],
        ),
        (
            "[inputs]",
            "[parameters]\nR1 = -1\n[inputs]",
            ["parameters.R1 = -1", "out of range", "0 … 1e+06 ohm"],
        ),
        ("[inputs]", "[parameters]\nR1 = '1 V'\n[inputs]", ["parameters.R1 = 1 V", "'V'", "'ohm'"]),
        (
            "[inputs]",
            "[parameters]\nR1 = nan\n[inputs]",
            ["parameters.R1 = nan", "'nan' is not a number"],
        ),
        ("[inputs]", "[parameters]\nR1 = [1]\n[inputs]", ["parameters.R1 = [1]", "a number"]),
        (
            "[inputs]",
            "[parameters]\ncurrent = 1\n[inputs]",
            ["parameters.current", "inputs.current"],
        ),
        (
            "[inputs]",
            "[noise.displacement]\nrms = 1e-6\n[inputs]",
            ["noise.displacement", "recorded outputs"],
        ),
        ("[inputs]", "[noise.voltage]\n[inputs]", ["noise.voltage.rms is missing"]),
        ("[inputs]", "[noise.voltage]\nrms = '1 A'\n[inputs]", ["noise.voltage.rms = 1 A", "'V'"]),
        (
            "[inputs]",
            "[noise.voltage]\nrms = -1\n[inputs]",
            ["noise.voltage.rms = -1", "0 or more"],
        ),
        (
            "[inputs]",
            "[noise.voltage]\nrms = 1\ncorrelation = 1\n[inputs]",
            ["voltage.correlation = 1", "than 1"],
        ),
        ("component =", 'over = "charge"\ncomponent =', ["over", "'charge'"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_experiments_that_cannot_be_made(folder, old, new, parts):
    assert old in GOOD
    (folder / "bad.toml").write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    line = refused(folder, "run", "bad.toml", "--out", "out.nc", "--plot", "out.png", parts=parts)
    assert line.startswith("error: bad.toml: ")


@pytest.mark.parametrize(
    ("stimulus", "parts"),
    [
        (
            'kind = "multilevel"\nlevels = [1]\ndwell = [1, 2]',
            ["levels = [1.0]", "two different values"],
        ),
        (
            'kind = "multilevel"\nlevels = [0, 1]\ndwell = [1, 2, 3]',
            ["inputs.current.dwell", "at most 2 items"],
        ),
        (
            'kind = "multilevel"\nlevels = [0, 1]\ndwell = ["1 A", 2]',
            ["inputs.current.dwell[0] = '1 A'", "'s'"],
        ),
        (
            'kind = "multisine"\nfrequencies = [1, 1]\nrms = 1',
            ["frequencies = [1.0, 1.0] Hz", "different"],
        ),
        ('kind = "multisine"\nfrequencies = [1]\nrms = -1', ["rms = -1", "0 or more"]),
        (
            'kind = "multisine"\nfrequencies = [1]\nrms = 1\nseed = true',
            ["inputs.current.seed = True", "valid integer"],
        ),
        (
            'kind = "multilevel"\nlevels = [0, 1]\ndwell = [1, 2]\nseed = true',
            ["seed = True", "valid integer"],
        ),
        (
            'kind = "multisine"\nfrequencies = [1, 5.1]\nrms = 1',
            ["frequencies[1] = 5.1 Hz", "at most 5 Hz", "0.1 s"],
        ),
        ('kind = "square"\namplitude = 1\nfrequency = 37', ["frequency = 37 Hz", "at most 5 Hz"]),
        (
            'kind = "sine"\namplitude = 1\nfrequency = "10 Hz"',
            ["frequency = 10 Hz", "at most 5 Hz"],
        ),
        (
            'kind = "chirp"\namplitude = 1\nstart_frequency = 1\nstop_frequency = 6',
            ["stop_frequency = 6 Hz", "5 Hz"],
        ),
        (
            'kind = "chirp"\namplitude = 1\nstart_frequency = 6\nstop_frequency = 1',
            ["start_frequency = 6 Hz", "5 Hz"],
        ),
        (
            'kind = "multilevel"\nlevels = [0, 1]\ndwell = [1e-8, 1]',
            ["dwell[0] = 1e-08 s", "at least 0.1 s, one step"],
        ),
        (
            'kind = "staircase"\nperiod = 0.1\nbias = 0\nincrement = 1\nmaximum = 3',
            ["period = 0.1 s", "0.2 s, two"],
        ),
        ('kind = "steps"\ntimes = [1, 1]\nlevels = [0, 1]', ["increasing times"]),
        ('kind = "ramps"\ntimes = [0, 1]\nlevels = [0]', ["increasing times"]),
        (
            'kind = "staircase"\nperiod = 1\nbias = 1\nincrement = 1\nmaximum = 1',
            ["maximum", "bias + increment"],
        ),
        ('kind = "gait"\nactuator = "an"', ["inputs.current", "'m'", "'A'"]),
        (
            'kind = "gait"\nactuator = "xx"',
            ["inputs.current.actuator = 'xx'", "'an', 'po', 'do' or 'pl'"],
        ),
        ('kind = "file"\nfile = "gone.csv"', ["gone.csv", "cannot be read"]),
        ('kind = "file"\nfile = "record.csv"\ncolumn = "I"', ["record.csv", "no column 'I'"]),
        (
            'kind = "file"\nfile = "record.csv"\nunit = "V"',
            ["record.csv", "V cannot be converted to A"],
        ),
        ('kind = "file"\nfile = "good.toml"', ["good.toml"]),
    ],
    ids=lambda value: value.replace("\n", " ") if isinstance(value, str) else "",
)
def test_stimuli_that_make_no_signal(folder, stimulus, parts):
    (folder / "bad.toml").write_text(GOOD.split("kind")[0] + stimulus, encoding="utf-8")
    refused(
        folder, "run", "bad.toml", "--out", "out.nc", parts=["bad.toml: inputs.current", *parts]
    )


def test_a_record_that_is_shorter_than_the_experiment(folder):
    stimulus = 'kind = "file"\nfile = "record.csv"'
    (folder / "long.toml").write_text(
        GOOD.replace('"2 s"', '"4 s"').split("kind")[0] + stimulus, encoding="utf-8"
    )
    refused(
        folder,
        "run",
        "long.toml",
        "--set",
        "duration=4.1",
        parts=["from 0 s to 3.9 s", "from 0 s to 4.1 s"],
    )


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["fig_3_33"], ["fig_3_33", "did you mean fig_3_3?"]),
        (["gone.toml"], ["gone.toml", "no such file"]),
        (["."], ["a folder"]),
        ([], ["ppy run --list"]),
        (["record.csv"], ["record.csv", "not a result of ppy run"]),
        (["out.nc"], ["out.nc", "not a result of ppy run"]),
        (["good.toml", "--set", "duration"], ["--set 'duration'", "key=value"]),
        (["good.toml", "--set", "R9=1"], ["no parameter named 'R9'"]),
        (
            ["good.toml", "--set", "durration=1"],
            ["no parameter named 'durration'", "did you mean duration?"],
        ),
        (
            ["good.toml", "--set", "inputs.force.value=1"],
            ["--set inputs.force.value=1", "force is a value"],
        ),
        (
            ["good.toml", "--set", "inputs.current.amplitud=1"],
            ["inputs.current: unknown key 'amplitud'"],
        ),
        (
            ["good.toml", "--set", "duration.of.it=1"],
            ["--set duration.of.it=1", "duration is a value"],
        ),
        (["good.toml", "--runtime", "fortran"], ["'native' or 'python'"]),
        (["good.toml", "--out", "out.xls"], ["--out out.xls", ".nc, .csv, .parquet"]),
        (
            ["good.toml", "--out", "good.toml"],
            ["--out good.toml", "experiment itself", "not be overwritten"],
        ),
        (["good.toml", "--out", "record.csv/out.nc"], ["cannot write record.csv/out.nc"]),
        (["good.toml", "--out", "."], ["--out .", "folder"]),
        (["good.toml", "--plot", "out.bmp"], ["out.bmp", ".png, .svg, .pdf"]),
        (["good.toml", "--out", "a.csv", "--plot", "a.csv"], ["both name a.csv"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_command_lines_that_ask_for_the_impossible(folder, arguments, parts):
    refused(folder, "run", *arguments, parts=parts)


def test_the_fastest_signals_that_the_step_can_show(folder):
    """Half the sampling rate and one step are allowed, however their amounts are written."""
    fastest = (
        'kind = "square"\namplitude = 1\nfrequency = "5000 mHz"',
        'kind = "multisine"\nfrequencies = [5]\nrms = 1',
        'kind = "multilevel"\nlevels = [0, 1]\ndwell = ["100 ms", 0.1]',
    )
    for stimulus in fastest:
        (folder / "fast.toml").write_text(GOOD.split("kind")[0] + stimulus, encoding="utf-8")
        assert here("run", "fast.toml", cwd=folder).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--out", "record.csv"], "record for current"),
        (["--plot", "record.html", "--out", "out.nc"], "record for force"),
        (["--plot", "page.html"], "component"),
        (["--out", "linked.csv"], "record for current"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_nothing_that_an_experiment_reads_is_overwritten(folder, arguments, what):
    shutil.copy(folder / "record.csv", folder / "record.html")
    shutil.copy(find_model("ppy_actuator").path, folder / "page.html")
    (folder / "linked.csv").hardlink_to(folder / "record.csv")
    text = GOOD.split("[inputs]")[0].replace('"ppy_actuator"', '"page.html"')
    text += (
        '[inputs]\ncurrent = {kind = "file", file = "record.csv"}\nforce = {kind = "file", file ='
        ' "record.html"}'
    )
    (folder / "own.toml").write_text(text, encoding="utf-8")
    refused(
        folder,
        "run",
        "own.toml",
        *arguments,
        parts=[arguments[1], f"the {what} itself", "not be overwritten"],
    )


def test_a_system_is_not_overwritten_by_its_page(folder):
    (folder / "page.html").write_bytes(b"")
    (folder / "own.toml").write_text(
        'system = "page.html"\n[inputs]\ncurrent = 0', encoding="utf-8"
    )
    refused(folder, "run", "own.toml", "--plot", "page.html", parts=["this is the system itself"])


@pytest.mark.parametrize(
    ("name", "target", "parts"),
    [
        ("∆", "new.nc", ["'∆.charge'", "NetCDF"]),
        ("a[1]", "new.csv", ["'a[1].charge'", "brackets", "CSV"]),
        pytest.param('say "a"', "new.csv", ["quotes", "CSV"], marks=pytest.mark.slow),
    ],
)
def test_names_that_a_format_cannot_hold_are_refused_before_the_run(
    folder, monkeypatch, name, target, parts
):
    """A system with such a member; in a format that can hold it, it comes back."""
    member = Member.of(name, component("ppy_actuator"), {"force": 0.0})
    ssp.write(
        System("odd", (member,), (), {"current": (Port(name, "current"),)}), folder / "odd.ssp"
    )
    (folder / "odd.toml").write_text(
        "system = 'odd.ssp'\nduration = 1\nstep = 0.1\nrecord ="
        f" ['{name}.charge']\n[inputs]\ncurrent = 1",
        "utf-8",
    )
    assert here("run", "odd.toml", "--out", "can.parquet", cwd=folder).returncode == 0
    assert "the same to the last bit" in here("run", "can.parquet", cwd=folder).stdout
    monkeypatch.setattr(master, "run", lambda *given, **options: pytest.fail("it ran"))
    refused(folder, "run", "odd.toml", "--out", target, parts=[target, *parts])


def test_an_input_of_a_member_that_is_fed_says_by_what(folder):
    for name, why in (
        ("actuator.length_change", "it receives bench.position"),
        ("actuator.current", "give it as inputs.current"),
        ("current", "give it as inputs.current"),
    ):
        text = f'system = "dma_bench"\n[parameters]\n"{name}" = 1\n'
        (folder / "bad.toml").write_text(text, encoding="utf-8")
        refused(folder, "run", "bad.toml", parts=[f"parameters.{name}: it is an input; {why}"])


def test_only_systems_whose_laws_are_known_are_fused(folder):
    member = Member.of("one", component("ppy_actuator"), {"force": 0.0})
    ssp.write(System("s", (member,), (), {"current": (Port("one", "current"),)}), folder / "s.ssp")
    (folder / "s.toml").write_text(
        'system = "s.ssp"\nmaster = {method = "fused"}\n[inputs]\ncurrent = 1', "utf-8"
    )
    refused(folder, "run", "s.toml", parts=["one (", "cannot be fused", "laws"])
