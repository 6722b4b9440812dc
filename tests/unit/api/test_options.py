"""Claims: every option has a meaning in words, and the default of what it is handed to."""

from __future__ import annotations

from orchestration.api import options as declarations
from orchestration.api.declaration import (
    options_of,
)
from orchestration.api.options import (
    StudyOptions,
)
from orchestration.identify.black_box import STRUCTURES
from orchestration.sweeps.reductions import KEPT


def test_defaults_are_those_of_what_is_called():
    assert options_of(StudyOptions)["structures"].default == STRUCTURES
    assert all(kept in options_of(declarations.SweepDesignOptions)["keep"].doc for kept in KEPT)


def test_an_option_of_the_command_line_has_help_for_it_and_python_a_meaning():
    classes = [one for one in vars(declarations).values() if hasattr(one, "__total__")]
    options = [option for one in classes for option in options_of(one).values()]
    assert len(options) > 100
    for option in options:
        assert option.doc or option.help, option.name
        assert (option.doc or option.help).endswith("."), option.name
