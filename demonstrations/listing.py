"""Commands of the demonstrations in the list of ``ppy --help``; this module imports nothing."""

COMMANDS = {
    "Find out what is wrong": {
        "characterise": (
            "Characterise an actuator: tests, parameters, what is missing.",
            "demonstrations.commands:characterise",
        ),
        "demo": (
            "Do everything once, with pictures and a report.",
            "demonstrations.commands:demo",
        ),
    },
    "Models, systems, experiments, rigs": {
        "thesis": (
            "Recompute the thesis, and say which figures are wrong and why.",
            "demonstrations.commands:thesis",
        ),
        "system cycles": (
            "Predict how many cycles of a work loop each limit allows.",
            "demonstrations.commands:cycles",
        ),
        "rig demo": (
            "Close the loop once, in real time, on an emulated rig in which an effect is hidden.",
            "demonstrations.commands:rig_demo",
        ),
    },
}
"""Line of help and function by heading of the help and name of the command."""
