"""Worked examples of every command, two each, as its help shows them; tests run them.

``demo-output`` is the folder that ``ppy demo`` leaves. Files without a folder are made by examples
of other commands: ``ppy build``, ``ppy system export``, ``ppy run``, ``ppy rig keys``.
"""

from __future__ import annotations

EXAMPLES = {
    "diagnose": (
        "ppy diagnose demo-output/hidden.csv --report diagnosis.html --fmu better.fmu",
        "ppy diagnose demo-output/record.csv --effects none --require recalibrate",
    ),
    "laws": (
        "ppy laws demo-output/hidden.csv --report laws.html",
        "ppy laws demo-output/hidden.csv --hold R1,C --time 20s --effect-out law.py",
    ),
    "compare": (
        "ppy compare demo-output/record.csv --fit R1,R2,C,alpha --plot compare.png",
        "ppy compare demo-output/record.csv --fit R1,R2,C,alpha,k1,k2,b2 --require 95%",
    ),
    "identify": (
        "ppy identify demo-output/record.csv --fit R1,R2,C --ssv fitted.ssv",
        "ppy identify demo-output/record.csv --fit R1,C --prior R1=0.43+-0.05ohm",
    ),
    "age": (
        "ppy age demo-output/record.csv --window 10s --report ageing.html",
        "ppy age demo-output/record.csv --window 20s --fit R1,C --of R1 --rise 20%",
    ),
    "frequency": (
        "ppy frequency demo-output/record.csv --of voltage/current --plot impedance.png",
        "ppy frequency demo-output/record.csv --model ppy_actuator --json -",
    ),
    "black-box": (
        "ppy black-box demo-output/record.csv --output voltage --inputs current",
        "ppy black-box demo-output/record.csv --output voltage --orders 1 --out own.py",
    ),
    "demo": ("ppy demo", "ppy demo --out first-look"),
    "new": (
        "ppy new component oven",
        "ppy new effect drag --model ppy_actuator --law terminal_voltage",
    ),
    "list": ("ppy list", "ppy list --json -"),
    "info": (
        "ppy info ppy_actuator",
        "ppy info fmu/native/ppy_actuator.fmu --json -",
    ),
    "build": (
        "ppy build ppy_actuator --set R1=0.61ohm --out with-r1",
        "ppy build ppy_actuator --runtime native --platforms linux64,win64",
    ),
    "export modelica": (
        "ppy export modelica",
        "ppy export modelica ppy_actuator --set R1=0.61 --out specimen",
    ),
    "check": (
        "ppy check fmu/native/ppy_actuator.fmu",
        "ppy check fmu/native/ppy_actuator.fmu --fail-on warning --junit check.xml",
    ),
    "simulate": (
        "ppy simulate ppy_actuator --set current=0.9 --stop 30s --plot run.png",
        "ppy simulate dma_bench.ssp --set force_reference=1N --stop 0.5s --out b.nc",
    ),
    "linearise": (
        "ppy linearise ppy_actuator --trim --fix displacement=0.1mm --free current",
        "ppy linearise dma_bench --set force_reference=1 --at 1s --plot bode.png",
    ),
    "design": (
        "ppy design ppy_actuator --command current --measured charge --sample-period 1s",
        "ppy design dma_bench --command current --measured voltage --sample-period 1s",
    ),
    "run": (
        "ppy run fig_3_4 --set duration=5s --out fig_3_4.nc --plot fig_3_4.html",
        "ppy run fig_3_4.nc --tolerance voltage=1mV,0.1% --report differences.html",
    ),
    "system list": ("ppy system list", "ppy system show dma_bench"),
    "system show": ("ppy system show dma_bench", "ppy system show dma_bench.ssp"),
    "system draw": (
        "ppy system draw dma_bench",
        "ppy system draw dma_bench.ssp --out bench.svg",
    ),
    "system export": (
        "ppy system export dma_bench",
        "ppy system export dma_bench --runtime python --out bench.ssd",
    ),
    "system pack": (
        "ppy system pack dma_bench --fmu bench.fmu",
        "ppy system pack dma_bench.ssp",
    ),
    "system check": ("ppy system check dma_bench.ssp", "ppy system check bench.ssd"),
    "characterise": (
        "ppy characterise demo-output/record.csv --out specimen",
        "ppy characterise demo-output/record.csv --set R1=0.5 --out another --json -",
    ),
    "system cycles": (
        "ppy system cycles",
        "ppy system cycles work_loop --set actuator.b1=1.2e6 --json -",
    ),
    "thesis": ("ppy thesis", "ppy thesis --out thesis.html --json thesis.json"),
    "sweep": (
        "ppy sweep ppy_actuator --over R1=0.3..0.7:9 --set current=0.5 --stop 10s",
        "ppy sweep ppy_actuator --set force=1 --over k1=4e3..8e3 --design tornado",
    ),
    "optimise": (
        "ppy optimise foot_design --over l3=15..40mm --maximise toe_stroke",
        "ppy optimise foot_design --over r_pl=5..30mm --maximise toe_force,toe_stroke",
    ),
    "rig serve": (
        "ppy rig serve --rate 1000 --archive archive",
        "ppy rig serve --bind 127.0.0.1 --keys keys/rig-server.toml --log rig.log",
    ),
    "rig watch": ("ppy rig watch", "ppy rig watch --no-browser --port 0"),
    "rig tune": ("ppy rig tune", "ppy rig tune bench.error_gain=0.5@0.02"),
    "rig record": (
        "ppy rig record --stimulus fig_3_4 --set duration=5s --out rig.csv",
        "ppy rig record --for 2s --out heard.nc",
    ),
    "rig calibrate": (
        "ppy rig calibrate bench.toml load --uncertainty 1e-3 --source M1 --by Volta",
        "ppy rig calibrate bench.toml load --point 8 --by V --source M1 --uncertainty 0",
    ),
    "rig archive": (
        "ppy rig archive archive",
        "ppy rig archive archive --from '2026-11-29 09:30' --out part.nc",
    ),
    "rig stop": ("ppy rig stop", 'ppy rig stop --reason "the clamp slips"'),
    "rig acknowledge": (
        "ppy rig acknowledge --latch 4820aeb249b43f32",
        "ppy rig acknowledge --alarm 1f6d727e --shelve 600",
    ),
    "rig status": ("ppy rig status", "ppy rig status --json -"),
    "rig log": ("ppy rig log rig.log", "ppy rig log rig.log.2 rig.log.1 rig.log"),
    "rig keys": ("ppy rig keys keys", "ppy rig keys keys --client desk --role watch"),
    "rig bridge": (
        "ppy rig bridge --endpoint tcp://rig:5570 --credentials keys/rig-client.toml",
        "ppy rig bridge --port 5590 --endpoint tcp://rig:5570 --credentials key.toml",
    ),
    "rig opcua": ("ppy rig opcua", "ppy rig opcua --port 4841 --lease 5"),
    "rig commission": (
        "ppy rig commission --yes --port 0",
        "ppy rig commission --yes --port 0 --level 0.2 --out rig.html",
    ),
    "rig demo": ("ppy rig demo", "ppy rig demo --seed 2 --out another-rig"),
}


def epilog(command: str) -> str:
    """Return the end of the help of a command: its examples, in the markup of rich.

    Parameters
    ----------
    command : str
        Such as ``rig serve``.
    """
    from rich.markup import escape  # which only help needs

    lines = [f"  {escape(example)}" for example in EXAMPLES.get(command, ())]
    return "\n".join(["[bold]Examples[/]", *lines]) if lines else ""
