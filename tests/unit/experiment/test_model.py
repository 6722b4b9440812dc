"""Claims: the tables of an experiment are checked, and what is wrong is a line with its key."""

import tomllib

import pytest

from fmus.kit import UserError
from orchestration.experiment.library import shipped
from orchestration.experiment.model import parse
from orchestration.experiment.reading import read
from tests.support.experiments import GOOD


def test_a_table_of_a_member_needs_no_quotes():
    given = tomllib.loads(
        'system = "dma_bench"\n[parameters]\nactuator.R1 = 1\nbench.mass = "30 g"'
    )
    assert parse(given, "test").parameters == {"actuator.R1": 1, "bench.mass": "30 g"}


def test_the_resolved_experiment_reads_back_as_itself():
    for name in shipped():
        experiment = read(name)
        assert parse(experiment.model_dump(mode="json", exclude_none=True), "again") == experiment


FUSED = 'system = "dma_bench"\nmaster = {method = "fused"'


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('component = "ppy_actuator"', "", ["a component or a system, one of them"]),
        ('component = "ppy_actuator"', 'component = "a"\nsystem = "b"', ["one of them"]),
        (
            "component =",
            'master = {method = "jacobi"}\ncomponent =',
            ["master is for a system", "on a component"],
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
            "[inputs]",
            '[variants]\n"" = {R1 = 0.5}\n[inputs]',
            ["variants: every variant needs a name"],
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
        ("step = 0.1", "step = 0", ["step = 0", "above 0"]),
        ("step = 0.1", "step = 1979-05-27", ["step = datetime.date(1979, 5, 27)", "finite number"]),
        ('["voltage"]', '"voltage"', ["record = 'voltage'", "valid list"]),
        ('"1 N"', "[1]", ["inputs.force.value = [1]", "finite number"]),
        ('kind = "square"\n', "", ["inputs.current.kind is missing"]),
        ('"square"', '"squaer"', ["inputs.current.kind = 'squaer'", "did you mean square?"]),
        (
            "amplitude",
            "amplitud",
            ["inputs.current", "unknown key 'amplitud'", "did you mean amplitude?"],
        ),
        ('amplitude = "0.9 A"\n', "", ["inputs.current.amplitude is missing"]),
        ('"0.5 Hz"', "0", ["inputs.current.frequency = 0", "above 0"]),
        ('"0.5 Hz"', '"3 rad/s"', ["inputs.current.frequency = '3 rad/s'", "'Hz'"]),
        ("[inputs]", "[parameters]\nR1 = [1]\n[inputs]", ["parameters.R1 = [1]", "a number"]),
        ("[inputs]", "[noise.voltage]\n[inputs]", ["noise.voltage.rms is missing"]),
        (
            "[inputs]",
            "[noise.voltage]\nrms = 1\ncorrelation = 1\n[inputs]",
            ["voltage.correlation = 1", "than 1"],
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_wrong_is_a_line_with_its_key_and_what_is_allowed(old, new, parts):
    assert old in GOOD
    with pytest.raises(UserError) as caught:
        parse(tomllib.loads(GOOD.replace(old, new, 1)), "bad.toml")
    message = str(caught.value)
    assert message.startswith("bad.toml: ")
    assert "\n" not in message
    for part in parts:
        assert part in message
