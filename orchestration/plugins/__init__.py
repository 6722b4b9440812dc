"""Plugins of a rig: calibrations, backends of hardware, a bridge, and the commissioning.

Nothing imports them: backends and commands are found by entry points, as those of anybody. This
module imports nothing.
"""

COMMANDS = {
    "Models, systems, experiments, rigs": {
        "rig calibrate": (
            "Adjust a measured signal at two known values, in its calibration file.",
            "orchestration.plugins.commands:calibrate",
        ),
        "rig commission": (
            "Try every protection of a rig on the real device.",
            "orchestration.plugins.commission.command:commission",
        ),
        "rig opcua": (
            "Show a rig in OPC UA, and let it be driven from there.",
            "orchestration.plugins.commands:opcua",
        ),
    },
}
"""Line of help and function by heading of the help and name of the command."""
