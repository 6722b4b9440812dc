"""Claims: an interrupted experiment with variants goes on from those that are done, to the same
result; a folder is of one experiment.
"""

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.experiment import read, run
from orchestration.journal import count_done
from tests.support.command import here, refused, works

FILE = """
component = "ppy_actuator"
duration = "2 s"
step = "0.1 s"
record = ["voltage"]
[inputs]
force = 1.0
[inputs.current]
kind = "sine"
amplitude = "0.5 A"
frequency = "0.5 Hz"
[noise.voltage]
rms = "1 mV"
[variants.small]
R1 = 0.4
[variants.middle]
R1 = 0.5
[variants.large]
R1 = 0.6
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "v.toml").write_text(FILE, encoding="utf-8")
    return tmp_path


def press_after(parts):
    def progress(done, whole):
        if done > parts * whole / 3:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("parts", [1, 2])
def test_an_interrupted_experiment_goes_on_to_the_same_result(folder, parts):
    path, part = str(folder / "v.toml"), folder / "part"
    whole = run(read(path), path)
    with pytest.raises(KeyboardInterrupt):
        run(read(path), path, press_after(parts), folder=part)
    assert count_done(part) == (parts, 3)
    computed = []
    again = run(read(path), path, lambda done, of: computed.append(done), folder=part)
    assert min(computed) > parts * 21
    assert [*again] == [*whole]
    for name in whole:
        np.testing.assert_array_equal(again[name].values, whole[name].values)
        assert again[name].attrs == whole[name].attrs
    own = {"created", "wall_time"}
    assert {k: v for k, v in again.attrs.items() if k not in own} == {
        k: v for k, v in whole.attrs.items() if k not in own
    }
    assert again.attrs["wall_time"] > 0.0
    assert ppy.run(path, folder=part)["small.voltage"].size == 21


def test_remarks_on_variants_that_are_kept_are_told_again(folder):
    path, part = str(folder / "v.toml"), folder / "part"
    beyond = ["inputs.current.amplitude=4 A"]
    whole, before, after = [], [], []
    run(read(path, beyond), path, note=whole.append)
    assert {line.partition(": ")[0] for line in whole} == {"small", "middle", "large"}
    with pytest.raises(KeyboardInterrupt):
        run(read(path, beyond), path, press_after(2), folder=part, note=before.append)
    run(read(path, beyond), path, folder=part, note=after.append)
    assert before == [line for line in whole if not line.startswith("large: ")]
    assert after == whole


def test_a_folder_keeps_variants_only(folder):
    single = FILE.partition("[variants")[0]
    (folder / "one.toml").write_text(single, encoding="utf-8")
    told = r"^folder='part' keeps variants that are done, and \S+one\.toml has none$"
    with pytest.raises(UserError, match=told):
        ppy.run(folder / "one.toml", folder="part")


def test_another_experiment_is_refused(folder):
    path = str(folder / "v.toml")
    run(read(path), path, folder=folder / "part")
    with pytest.raises(UserError, match=r"another experiment \(not the same: the experiment\)"):
        run(read(path, ["R2=1.5"]), path, folder=folder / "part")


def test_the_command_says_what_is_kept_and_goes_on(folder, monkeypatch):
    from orchestration.experiment import execution

    plain = execution._run_prepared
    calls = []

    def pressed(*arguments):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return plain(*arguments)

    monkeypatch.setattr(execution, "_run_prepared", pressed)
    done = here("run", "v.toml", "--out", "v.nc", cwd=folder)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == (
        "interrupted: 2 of 3 variants are kept in v.nc.part, and the same command goes on from"
        " there"
    )
    refused(folder, "run", "v.toml", "--set", "R2=1.5", "--out", "v.nc", parts=["v.nc.part"])
    works("run", "v.toml", "--out", "v.nc", cwd=folder)
    assert len(calls) == 4
    assert sorted(path.name for path in folder.iterdir()) == ["v.nc", "v.toml"]


def test_without_a_file_the_last_line_says_what_would_keep_them(folder, monkeypatch):
    def pressed(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("orchestration.experiment.execution._run_prepared", pressed)
    done = here("run", "v.toml", cwd=folder)
    assert done.returncode == 130
    last = "interrupted: nothing is kept; with --out FILE the same command would go on"
    assert done.stderr.splitlines()[-1] == last
    done = here("run", "v.toml", "--out", "v.nc", cwd=folder)
    assert done.stderr.splitlines()[-1] == "interrupted: none of the variants was done"
