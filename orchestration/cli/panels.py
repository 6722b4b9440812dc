"""Panels of options in the help of a command, by the subject of an option.

An option of one name is about the same in every command.
"""

from __future__ import annotations

_PANELS = {
    "Model": (
        "model",
        "of_model",
        "laid_over",
        "settings",
        "preset",
        "runtime",
        "fmi",
        "system",
        "connectors",
        "law",
    ),
    "Record": (
        "mapping",
        "columns",
        "decimal",
        "table",
        "begin",
        "end",
        "rows",
        "segment",
        "discard",
        "input_file",
        "runs",
        "each",
        "holdout",
        "interpolate",
        "period",
        "band",
    ),
    "Operating point": ("at", "trim", "fix", "free", "drift"),
    "Time": ("stop", "step", "tolerance", "rate", "max_age"),
    "Signals": ("output", "inputs", "outputs", "cut", "of"),
    "Fit and search": (
        "fit",
        "profile",
        "effects",
        "hold",
        "time",
        "compare",
        "laws",
        "explain",
        "workers",
        "share",
        "structures",
        "path_orders",
        "noise_orders",
        "delays",
        "criterion",
    ),
    "Cases": (
        "over",
        "fitted",
        "kind",
        "samples",
        "maximise",
        "minimise",
        "levels",
        "starts",
        "seed",
        "keep",
        "engine",
        "scheduler",
    ),
    "Device": ("backend", "backend_options", "watchdog", "stuck_after", "lockstep"),
    "Rig": ("stimulus", "latch", "reason", "beyond_limits"),
    "Network": ("endpoint", "host", "port", "keys", "credentials", "timeout", "client", "role"),
    "Real time": ("real_time", "missed", "lag", "processor", "priority", "cpu"),
    "Results": (
        "require",
        "json",
        "mat",
        "out",
        "plot",
        "profile_plot",
        "report",
        "fmu",
        "fmus",
        "platforms",
        "ssp",
        "ssv",
        "experiment",
        "effect_out",
        "log",
        "state",
        "show_list",
        "browser",
    ),
    "FMUs of others": ("isolate", "step_timeout", "memory_limit"),
}
_PANEL_OF = {name: panel for panel, names in _PANELS.items() for name in names}


def panel_of(option: str) -> str | None:
    """Return the panel that shows an option; None for that of ``--help``."""
    return _PANEL_OF.get(option)
