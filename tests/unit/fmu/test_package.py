"""Claims: the package offers what users need, and loads what runs FMUs only when it is asked
for.
"""

import subprocess
import sys

import pytest

import orchestration.fmu
from orchestration.fmu import Fmu, Model, find_model, instance, model


def test_the_package_offers_what_users_need():
    assert (Fmu, Model, find_model) == (instance.Fmu, model.Model, model.find_model)
    with pytest.raises(AttributeError, match=r"orchestration.fmu .*Motor"):
        orchestration.fmu.Motor  # noqa: B018


def test_importing_the_package_loads_nothing_heavy():
    code = "import sys, orchestration.fmu; print(*({'numpy', 'fmpy', 'casadi'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
