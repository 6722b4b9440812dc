"""The commands of the demonstrations as ``ppy --help`` lists them; reading this loads nothing."""

COMMANDS = {
    "Find out what is wrong": {
        "demo": (
            "Do everything once, with pictures and a report.",
            "demonstrations.commands:demo",
        ),
    },
    "Models, systems, experiments, rigs": {
        "thesis": (
            "Recompute the thesis: what holds, what does not and why.",
            "demonstrations.commands:thesis",
        ),
        "rig demo": (
            "Close the loop once, in real time, on an emulated rig in which an effect is hidden.",
            "demonstrations.commands:rig_demo",
        ),
    },
}
"""By heading of the help and name of the command: a line of help, and the function."""
