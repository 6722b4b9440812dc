import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fmus
from fmus.kit import UserError
from fmus.kit.symbolic import codegen
from fmus.kit.symbolic.tracing import trace
from tests.support.kit_models import GUID, telling_models
from tests.support.kit_samples import Thermostat
from tests.support.small_disk import disk_of_64_kib


@telling_models
def test_generated_sources_are_deterministic(cls):
    first, second = (codegen.native_sources(trace(cls), GUID) for _ in range(2))
    assert first == second
    assert set(first) == {"model.h", "tables.h", "laws.c"}
    assert first["laws.c"].startswith("#define CASADI_SYMBOL_EXPORT static inline\n")
    for n, _ in enumerate(cls.layout.sampled):
        assert f"X(update_{n})" in first["model.h"]


@telling_models
def test_laws_for_records_ask_for_no_array_and_have_no_function_for_hosts(cls):
    hosted, bare = (codegen.native_sources(trace(cls), GUID, hosted) for hosted in (True, False))
    assert ("? arg[" in bare["laws.c"], "!=0) res[" in bare["laws.c"]) == (False, False)
    for name in ("tangent", "indicators"):
        assert f"int {name}(" in hosted["laws.c"]
        assert f"int {name}(" not in bare["laws.c"]
    assert bare["tables.h"] == hosted["tables.h"]


@pytest.mark.slow
def test_generated_sources_do_not_depend_on_the_hash_seed_or_the_folder(tmp_path):
    code = (
        "import hashlib, fmus; from fmus.kit import stack; from fmus.kit.build.package import"
        " python_package;"
        "from fmus.kit.symbolic import codegen; from fmus.kit.symbolic.tracing import trace;"
        "from fmus.ppy_actuator.effects import EFFECTS;"
        "cls = stack(fmus.component('ppy_actuator'), *EFFECTS.values());"
        "files = codegen.native_sources(trace(cls), 'g') | python_package(cls);"
        "print(hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest())"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            cwd=folder,
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(fmus.__file__).parents[1])},
        ).stdout
        for seed, folder in (("1", tmp_path), ("2", Path.cwd()))
    }
    assert len(digests) == 1


def test_tables_carry_start_values_ranges_and_groups():
    files = codegen.lawless_sources(trace(Thermostat), GUID)
    sizes = dict(re.findall(r"#define MODEL_(\w+) (\d+)", files["model.h"]))
    assert sizes == {
        "PARAMETERS": "12",
        "INPUTS": "2",
        "STATES": "2",
        "DISCRETES": "3",
        "OUTPUTS": "2",
        "GROUPS": "2",
        "TEXTS": "0",
        "INDICATORS": "0",
    }
    body = files["tables.h"]
    assert '{"stages", "1", ROLE_PARAMETER, TYPE_INTEGER, 2.0, 1.0, 5.0, 1.0, false},' in body
    assert '{"boost", "1", ROLE_INPUT, TYPE_BOOLEAN, 0.0, -INFINITY, INFINITY, 1.0, false},' in body
    assert "model_start_of[] = {7, 8, 9, 10, 11};" in body
    assert "{0.0, 6, {-1, -1}}," in body
    assert "{0.3, -1, {-1, -1}}," in body


def test_laws_of_which_a_disk_takes_a_part_are_not_used(tmp_path, monkeypatch):
    """CasADi writes what fits, and reports nothing."""
    graph = trace(Thermostat)
    with disk_of_64_kib(tmp_path / "disk") as disk:
        (disk / "other").write_bytes(bytes(56 * 1024))
        monkeypatch.setattr("tempfile.tempdir", str(disk))
        with pytest.raises(
            UserError, match=rf"^{disk}: temporary files cannot be written there \(No space left"
        ):
            codegen.native_sources(graph, GUID)
        (disk / "other").unlink()
        assert "laws.c" in codegen.native_sources(graph, GUID)


def test_any_text_is_a_literal_of_c():
    # octal escapes and bytes are those of Python's literals, too
    for text in ("a.b/c", 'quo"te\\', "line\nbreak\0", "??/ trigraph", "é 😀 \u202e", "*/ %s 7"):
        literal = codegen.c_string(text)
        assert literal.isascii()
        assert literal.isprintable()
        assert "??" not in literal
        assert ast.literal_eval(f"b{literal}") == text.encode()
