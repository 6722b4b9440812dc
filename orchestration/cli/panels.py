"""Panels of options in the help of a command, by the subject of an option.

An option of one name is about the same in every command.
"""

from __future__ import annotations

_PANELS = {
    "Model": (
        "model of_model laid_over settings units preset runtime fmi clocks system connectors law"
    ),
    "Record": (
        "mapping columns decimal table begin end rows segment discard input_file runs each"
        " holdout interpolate period band"
    ),
    "Operating point": "at trim fix free drift",
    "Controller": (
        "command measured controller controller_settings sample_period phase_margin"
        " crossover delay limits"
    ),
    "Time": "state_in stop step tolerance model_exchange rate max_age duration since until",
    "Signals": "output inputs outputs cut of",
    "Fit and search": (
        "fit profile posterior bounds scale prior tie noise loss effects hold time compare"
        " laws explain workers share window frequency rise derating structures path_orders"
        " noise_orders delays criterion"
    ),
    "Cases": (
        "over fitted kind samples maximise minimise levels starts seed keep engine scheduler"
    ),
    "Device": "backend backend_options watchdog stuck_after lockstep lease",
    "Rig": (
        "stimulus take_over latch alarm shelve reason beyond_limits alarm_hook points"
        " duration uncertainty source by level yes"
    ),
    "Network": "endpoint run host port keys credentials password no_keys timeout client role",
    "Real time": "real_time missed lag processor priority cpu tunable tuning_port",
    "Results": (
        "require accept fail_on tube json junit mat out plot profile_plot corner report fmu"
        " fmus platforms ssp ssv experiment effect_out log log_calls state_out archive"
        " archive_size state show_list browser"
    ),
    "FMUs of others": "isolate step_timeout memory_limit",
}
_PANEL_OF = {name: panel for panel, names in _PANELS.items() for name in names.split()}


def panel_of(option: str) -> str | None:
    """Return the panel that shows an option; None for that of ``--help``."""
    return _PANEL_OF.get(option)
