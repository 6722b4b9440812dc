"""Plugins of a rig: calibrations, backends of hardware and a bridge, each on a library of an extra.

Nothing imports them: backends and commands are found by entry points, as those of anybody. This
module imports nothing.
"""

COMMANDS = {
    "Models, systems, experiments, rigs": {
        "rig calibrate": (
            "Adjust a measured signal at two known values, in its calibration file.",
            "orchestration.plugins.commands:calibrate",
        ),
        "rig opcua": (
            "Show a rig in OPC UA, and let it be driven from there.",
            "orchestration.plugins.commands:opcua",
        ),
    },
}
"""Line of help and function by heading of the help and name of the command."""
