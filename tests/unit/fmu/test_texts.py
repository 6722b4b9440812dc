"""Claims: a text reaches an FMU from everywhere a parameter can be set, and is never taken for a
number.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration import master
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import find_model
from orchestration.system import Member, System, ssp
from orchestration.system import checking as check
from tests.support.command import here, refused, works
from tests.support.master.sleeper import build_sleeper

ENDPOINT = "tcp://127.0.0.1:5570"
UMLAUT = "Prüfstand ½ & <1>"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return build_sleeper(tmp_path_factory.mktemp("sleeper"))


def told(text: str) -> tuple[int, int]:
    """Number and sum of the bytes of a text in UTF-8, which FMI prescribes."""
    return len(text.encode()), sum(text.encode())


def answered(signals, prefix="") -> tuple[int, int]:
    return int(signals[f"{prefix}characters"][-1]), int(signals[f"{prefix}checksum"][-1])


def read(fmu: Fmu) -> tuple[int, int]:
    fmu.start()
    row = np.empty(2)
    fmu.reader(["characters", "checksum"])(row)
    return int(row[0]), int(row[1])


@pytest.mark.parametrize("text", [ENDPOINT, "", "5", UMLAUT])
def test_an_instance_sets_a_text(fmu, text):
    with Fmu(fmu, {"label": text}) as instance:
        assert read(instance) == told(text)
    with Fmu(fmu) as instance:
        assert read(instance) == told("abc")


def test_a_model_reads_texts_as_they_are_and_numbers_as_ever(fmu):
    model = find_model(str(fmu))
    assert model.parameters["label"].default == "abc"
    assert model.settings(["label=0.5 m", "delay=10 "]) == {"label": "0.5 m", "delay": 10.0}
    assert model.settings([f"label={ENDPOINT}?a=b"]) == {"label": f"{ENDPOINT}?a=b"}


def test_a_master_passes_texts_to_members_and_checks_them_before(fmu):
    system = System("two", (Member("a", fmu, {"label": ENDPOINT}), Member("b", fmu)), ())
    signals = master.run(system, np.array([0.0, 0.1])).signals
    assert (answered(signals, "a."), answered(signals, "b.")) == (told(ENDPOINT), told("abc"))
    for given, name, parts in [
        (5.0, "label", "label: 5.0 is a number; .* a text"),
        ("x", "delay", "'x' is a text; .* real"),
    ]:
        with pytest.raises(UserError, match=parts):
            check.check(system.given({f"a.{name}": given}))


def test_an_ssp_carries_texts_there_and_back(fmu, tmp_path):
    system = System("one", (Member("a", fmu, {"label": UMLAUT, "until": 0.5}),), ())
    path = tmp_path / "one.ssp"
    ssp.write(system, path)
    again = ssp.read(path, tmp_path / "unpacked")
    assert again.member("a").parameters == {"label": UMLAUT, "until": 0.5}
    assert answered(master.run(again, np.array([0.0, 0.1])).signals, "a.") == told(UMLAUT)


def test_the_command_line_sets_and_shows_texts(fmu, tmp_path):
    done = works("simulate", fmu, "--set", f"label={ENDPOINT}", "--out", "out.csv", cwd=tmp_path)
    assert str(told(ENDPOINT)[1]) in done
    shown = works("info", fmu, "--json", "-", cwd=tmp_path)
    parameter = next(p for p in json.loads(shown)["parameters"] if p["name"] == "label")
    assert (parameter["start"], parameter["type"]) == ("abc", "string")
    assert "label     'abc'    any text" in works("info", fmu, cwd=tmp_path)
    refused(
        tmp_path,
        "simulate",
        fmu,
        "--set",
        "delay=tcp",
        parts=["delay=tcp", "'tcp' is not a number"],
    )


@pytest.mark.slow
def test_an_experiment_sets_texts_and_its_result_remembers_them(fmu, tmp_path):
    text = f'component = "{fmu}"\nduration = 0.2\nstep = 0.1\n[parameters]\nlabel = "{ENDPOINT}"\n'
    (tmp_path / "one.toml").write_text(text)
    works("run", "one.toml", "--out", "one.nc", cwd=tmp_path)
    from orchestration.experiment import results

    data = results.read(tmp_path / "one.nc")
    assert (int(data.characters[-1]), int(data.checksum[-1])) == told(ENDPOINT)
    assert json.loads(data.attrs["parameters"]) == {"label": ENDPOINT}
    again = here("run", "one.nc", cwd=tmp_path)
    assert "every value is the same to the last bit" in again.stdout
    assert (
        f" {told('ipc:///x')[1]} "
        in works("run", "one.toml", "--set", "label=ipc:///x", cwd=tmp_path) + " "
    )
    refused(
        tmp_path,
        "run",
        "one.toml",
        "--set",
        "label=5",
        parts=["parameters.label = 5", "a number", "a text"],
    )
    refused(
        tmp_path,
        "run",
        "one.toml",
        "--set",
        "delay=soon",
        parts=["parameters.delay = soon", "not a number"],
    )


def test_an_experiment_on_a_system_sets_texts_of_members(fmu, tmp_path):
    ssp.write(System("one", (Member("proxy", fmu),), ()), tmp_path / "one.ssp")
    text = (
        'system = "one.ssp"\nduration = 0.2\nstep = 0.1\n[parameters]\nproxy.label ='
        f' "{ENDPOINT}"\n'
    )
    (tmp_path / "one.toml").write_text(text)
    assert str(told(ENDPOINT)[1]) in works("run", "one.toml", cwd=tmp_path)
    assert "values given to it" in works("system", "show", "one.ssp", cwd=tmp_path)


def test_a_proxy_can_be_built_with_an_address_of_its_own(tmp_path):
    done = works(
        "build",
        "rig_proxy",
        "--runtime",
        "python",
        "--set",
        f"endpoint={ENDPOINT}0",
        "--out",
        "fmus",
        cwd=tmp_path,
    )
    assert "rig_proxy_set.fmu" in done
    model = find_model(str(tmp_path / "fmus" / "python" / "rig_proxy_set.fmu"))
    assert model.parameters["endpoint"].default == f"{ENDPOINT}0"
    assert model.parameters["on_stale"].default == "hold"
    assert model.notes == ()  # the class behind it is found again
