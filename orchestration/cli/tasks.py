"""Tasks in the words of those who have them, each with the command for it.

``ppy --help WORDS`` searches them.
"""

from __future__ import annotations

import re
from collections.abc import Collection

_TASKS = {
    "find out what is wrong with a model of a motor, a battery, a muscle: what law is missing": (
        "ppy diagnose RECORD --model MODEL --report page.html"
    ),
    "diagnose a folder of records, a batch of files, many specimens or cells": (
        "ppy diagnose FOLDER --model MODEL --workers 4"
    ),
    "fit several records at once with shared parameters": (
        "ppy diagnose RECORD RECORD --model MODEL --effects none --no-laws"
    ),
    "see what changed between two records: ageing, wear, drift, before and after": (
        "ppy diagnose BEFORE --compare AFTER --compare LATER --model MODEL"
    ),
    "forecast the life of an actuator: ageing, degradation, remaining life, derating": (
        "ppy age RECORD|FOLDER"
    ),
    "test one suspected effect, such as friction, dead zone, backlash, lag, saturation": (
        "ppy diagnose RECORD --model MODEL --effects 'dead_zone(INPUT)'"
    ),
    "list the effects, causes, parameters, units and ports of a model or FMU": "ppy info MODEL",
    "look at a record, a csv file, columns and units, before anything else": "ppy info RECORD",
    "characterise a new actuator or specimen: creep, circuit, coupling, all its parameters": (
        "ppy characterise FOLDER"
    ),
    "find a law or an equation from data without naming effects": "ppy laws RECORD --model MODEL",
    "validate a model: how well does it fit a record, goodness of fit in percent": (
        "ppy compare RECORD --model MODEL"
    ),
    "calibrate, estimate or fit parameters with intervals, parameter estimation": (
        "ppy identify RECORD --model MODEL --fit NAME,NAME"
    ),
    "impedance spectroscopy, frequency response, transfer function, Bode from data": (
        "ppy frequency RECORD --of voltage/current"
    ),
    "identify a black-box model: ARX, output error, Box-Jenkins, transfer function": (
        "ppy black-box RECORD --output NAME --inputs NAME"
    ),
    "tune a loop: design a controller, PID gains, phase margin": "ppy design MODEL",
    "margins of a loop, stability, gain and phase margin, Bode, poles, Nyquist": (
        "ppy linearise SYSTEM --cut MEMBER.INPUT"
    ),
    "linear state space of a model or FMU at an operating point, trim, equilibrium": (
        "ppy linearise MODEL --trim"
    ),
    "tune a loop or change gains and parameters while a rig runs": "ppy rig tune",
    "optimise a design, find the best parameters, Pareto front": (
        "ppy optimise MODEL --over NAME=LOW..HIGH --maximise OUTPUT"
    ),
    "vary parameters: sweep, Monte Carlo, sensitivity, Sobol, tornado": (
        "ppy sweep MODEL --over NAME=LOW..HIGH:9"
    ),
    "simulate an FMU with a record or constant inputs, and plot it": (
        "ppy simulate MODEL --input RECORD --plot run.png"
    ),
    "connect FMUs, couple them, co-simulation, SSP": "ppy system check SYSTEM.ssp",
    "run an experiment with a stimulus, and save the result": "ppy run EXPERIMENT --out run.nc",
    "check an FMU against the standard, in continuous integration": "ppy check FILE.fmu",
    "hand an FMU over, export a model as an FMU, build for Windows": (
        "ppy build MODEL --platforms linux64,win64"
    ),
    "write a model, a component, an effect or a driver of my own, from a template": (
        "ppy new component NAME"
    ),
    "export to Modelica, OpenModelica, Dymola": "ppy export modelica MODEL",
    "hardware in the loop, serve a rig, a test bench": "ppy rig serve",
    "record or log measurements from a rig": "ppy rig record --for 10s --out heard.nc",
    "watch a rig live in the browser, dashboard": "ppy rig watch",
    "emergency, stop the rig": "ppy rig stop",
}
_MOST = 4


def tasks(words: str, commands: Collection[str]) -> list[tuple[str, str]]:
    """Return the tasks that some words are about, each with its command, best first.

    Parameters
    ----------
    words : str
        Such as ``tune a loop``. Small words count for nothing, nor do endings.
    commands : collection of str
        The commands that there are; those of packages may be missing.

    Returns
    -------
    list of tuple of str
        Empty if no task has any of the words.
    """
    wanted = _stems(words)
    found = []
    for task, command in _TASKS.items():
        shared = len(wanted & _stems(f"{task} {command}"))
        if shared and command.split()[1] in commands:
            found.append((shared, task, command))
    found.sort(key=lambda one: -one[0])
    return [(task, command) for shared, task, command in found if 2 * shared >= found[0][0]][:_MOST]


def _stems(text: str) -> set[str]:
    """Return the words of a text in small letters, without small words and endings."""
    words = re.findall(r"[a-z]{3,}", text.lower())
    return {word[:5].rstrip("se") for word in words} - {"the", "and", "how", "for", "with"}
