"""Claims: a signal is what the table of its stimulus says, in closed form; one that makes none
is refused.
"""

import tomllib
from itertools import pairwise

import numpy as np
import pytest

from fmus.kit.registry import ComponentPackage, RegistryWarning, StimulusDeclaration
from orchestration.experiment.execution import run
from orchestration.experiment.model import parse
from orchestration.experiment.stimulus import declared_kinds
from orchestration.records import write_record
from tests.support.command import here, refused
from tests.support.experiments import GOOD, good_experiment
from tests.support.registered import registered


@pytest.fixture
def folder(tmp_path):
    return good_experiment(tmp_path)


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
            ["period = 0.1 s", "at least 0.2 s, 2 steps"],
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


def make(text, *settings, tmp_path=None):
    """Make the experiment of a TOML text."""
    given = tomllib.loads(text)
    return run(
        parse(
            given | {k: tomllib.loads(v) for k, v in settings}, "test", tmp_path and str(tmp_path)
        )
    )


ON = 'component = "ppy_actuator"\nduration = 10\nstep = 0.01\nrecord = []\n'


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ('force = "1500 mN"', lambda t: np.full(t.size, 1.5)),
        ("force = { kind = 'constant', value = 2 }", lambda t: np.full(t.size, 2.0)),
        (
            (
                "force = { kind = 'square', amplitude = '0.5 N', offset = 1, frequency = 0.25,"
                " delay = '1 s' }"
            ),
            lambda t: np.where(
                (t > 0.995) & (t < 2.995) | (t > 4.995) & (t < 6.995) | (t > 8.995), 1.5, 0.5
            ),
        ),
        (
            "force = { kind = 'sine', amplitude = 1, offset = '2 N', frequency = '300 mHz' }",
            lambda t: 2 + np.sin(0.6 * np.pi * t),
        ),
        (
            (
                "force = { kind = 'chirp', amplitude = 1, offset = 2, start_frequency = 0.1,"
                " stop_frequency = 0.9 }"
            ),
            lambda t: 2 + np.sin(2 * np.pi * (0.1 * t + 0.04 * t**2)),  # 0.1 to 0.9 Hz over 10 s
        ),
        (
            "force = { kind = 'ramps', times = [1, 3, 4], levels = [0, '2000 mN', 1] }",
            lambda t: np.select([t < 1, t < 3, t < 4], [0, t - 1, 5 - t], 1.0),
        ),
        (
            "force = { kind = 'steps', initial = 1, times = ['2 s', 5], levels = [2, 3] }",
            lambda t: np.select([t < 1.995, t < 4.995], [1.0, 2.0], 3.0),
        ),
        ("force = '1500 mN@2 s'", lambda t: np.where(t < 1.995, 0.0, 1.5)),
        (
            "force = '1.5 N@2s@500 mN/s'",
            lambda t: np.clip(0.5 * (t - 2.0), 0.0, 1.5),
        ),
        (
            (
                "force = { kind = 'staircase', period = 4, bias = '0.5 N', increment = 1, maximum ="
                " 2.5 }"
            ),
            lambda t: np.select([t < 1.995, t < 3.995, t < 5.995], [1.5, 0.5, 2.5], 0.5),
        ),
    ],
    ids=lambda value: value.split("'")[1] if isinstance(value, str) and "'" in value else "",
)
def test_stimuli_of_a_file_in_closed_form(table, expected):
    found = make(ON + "[inputs]\ncurrent = 0\n" + table)
    assert found.force.values == pytest.approx(expected(found.time.values), abs=1e-9)


def test_multisine_of_a_file_has_its_lines_and_random_phases():
    table = (
        "current = { kind = 'multisine', frequencies = [0.5, 1.5, 4], rms = '300 mA', offset ="
        " 0.1 }"
    )
    first, second = (
        make(f"seed = {seed}\n" + ON + "[inputs]\n" + table).current.values[:-1] for seed in (1, 2)
    )
    for wave in (first, second):
        lines = 2 * np.abs(np.fft.rfft(wave - 0.1)) / wave.size
        expected = np.zeros(lines.size)
        expected[[5, 15, 40]] = 0.3 * np.sqrt(2 / 3)
        np.testing.assert_allclose(lines, expected, atol=1e-12)
    assert np.any(np.abs(first - second) > 0.1)


def test_random_signals_do_not_change_when_others_come_or_when_they_have_seeds_of_their_own():
    levels = "{ kind = 'multilevel', levels = [0, 1], dwell = [0.2, 0.5] }"
    alone = make(ON + f"[inputs]\ncurrent = {levels}")
    both = make(ON + f"[inputs]\nforce = {levels}\ncurrent = {levels}")
    assert alone.current.values.tobytes() == both.current.values.tobytes()
    assert np.any(both.force.values != both.current.values)
    own = levels.replace("}", ", seed = 5 }")
    one, other = (
        make(f"seed = {n}\n" + ON + f"[inputs]\nforce = {own}\ncurrent = {own}") for n in (1, 2)
    )
    assert one.force.values.tobytes() == other.current.values.tobytes()


def test_gait_is_eqs_5_13_to_5_16():
    """Eq. 5.16 as in appendix A4 (errata 14)."""
    expected = {"an": (-1, 0), "po": (1, 0), "do": (-1, -1), "pl": (1, 1)}
    for actuator, (sign, shift) in expected.items():
        text = (
            'component = "ppy_actuator_length_driven"\nduration = 1\nstep = 0.01\nrecord ='
            " []\n[inputs.length_change]\n"
        )
        found = make(text + f"kind = 'gait'\nactuator = '{actuator}'")
        wave = sign * np.sin(2 * np.pi * found.time.values) + shift  # mm
        assert 1e3 * found.length_change.values == pytest.approx(wave, abs=1e-12)


def test_a_column_of_a_file_is_held_and_its_flaws_are_told(tmp_path):
    time = np.arange(0.0, 3.0, 0.5)
    write_record(tmp_path / "r.csv", time, {"I": 100.0 * time}, {"I": "mA"})
    lines = (tmp_path / "r.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "r.csv").write_text("\n".join([*lines[:3], lines[2], *lines[3:]]), encoding="utf-8")
    text = 'component = "ppy_actuator"\nduration = 2\nstep = 0.25\n[inputs]\nforce = 0\n'
    notes = []
    given = tomllib.loads(text + "current = { kind = 'file', file = 'r.csv', column = 'I' }")
    found = run(parse(given, "test", str(tmp_path)), note=notes.append)
    assert found.current.values == pytest.approx(0.1 * np.repeat(np.arange(5), 2)[:9] / 2)
    assert any("repeat the time" in line for line in notes)
    given["inputs"]["current"]["unit"] = "A"  # the numbers are to be read as something else
    assert run(parse(given, "test", str(tmp_path))).current.values[-1] == pytest.approx(200.0)


def test_multilevel_stays_as_long_as_dwell_says():
    found = make(
        ON + "[inputs.current]\nkind = 'multilevel'\nlevels = [-1, 0, 1]\ndwell = ['1 s', '2 s']"
    )
    switches = found.time.values[1:][np.diff(found.current.values) != 0]
    assert all(0.99 <= later - earlier <= 2.01 for earlier, later in pairwise(switches))
    assert len(switches) >= 4


def test_a_package_cannot_replace_a_kind_that_there_is():
    square = StimulusDeclaration("A square.", "side", ("left",), "m", "no_such_module:sides")
    package = ComponentPackage(stimuli={"square": square})
    with registered(tank=package), pytest.warns(RegistryWarning, match="'square' of a package"):
        assert [kind.__name__ for kind in declared_kinds()] == ["Gait"]
