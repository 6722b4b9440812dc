"""``ppy info``: signals, parameters, limits of a model, columns of a record, or a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kit import UserError
from fmus.kit.declare import summary
from fmus.kit.effects import effect_name, made_by, unstack
from fmus.kit.sensors import transport_delay
from orchestration.api.declaration import stated_of
from orchestration.api.options import ReadingOptions
from orchestration.cli.command import command
from orchestration.cli.commands.options import InfoCommand
from orchestration.cli.outputs import check_outputs, show_and_write, write_json
from orchestration.reporting import flag, plain_table
from orchestration.reporting.console import note, out

if TYPE_CHECKING:
    from fmus.kit import Component, Effect
    from orchestration.fmu import Signal


@command(InfoCommand)
def info(options: InfoCommand) -> None:
    """Show a model's variables and effects, a record's columns, or a diagnosis as it was shown."""
    from orchestration.cli.record_overview import is_record, record_info

    model = options["model"]
    path = options["json"]
    if model.lower().endswith(".json"):
        _show_diagnosis(options)
        return
    if options["report"] is not None:
        raise UserError(f"--report: {model} is no diagnosis (.json), of which there is a page")
    if is_record(model):
        record_info(options)
        return
    stated = stated_of(ReadingOptions, options)
    if options["of_model"] is not None or stated:
        name = flag(stated[0]) if stated else "--model"
        raise UserError(f"{name}: {model} is no record; {name} is for ppy info RECORD")
    check_outputs(options)
    known = _facts_of(model, options["laid_over"])
    _show(known)
    write_json(path, _as_json(known))


def _show_diagnosis(options: InfoCommand) -> None:
    """Show a diagnosis from its file as it was shown when it was made."""
    from orchestration.api import load

    file = Path(options["model"])
    check_outputs(options, {"the diagnosis": file})
    stored = load(file)
    show_and_write(stored, options, report=stored.report)


class _Facts(NamedTuple):
    """Facts about a model; an FMU without equations has the first ones only."""

    name: str
    summary: str
    signals: Mapping[str, Sequence[Signal]]
    step: float | None = None
    remarks: Sequence[str] = ()
    tolerance: float | None = None
    sources: Mapping[str, str] = {}
    presets: Mapping[str, str] = {}
    made_from: str = ""
    laid_over: Sequence[str] = ()
    effects: Mapping[type[Effect], str] = {}  # each with the assumption that it relaxes


def _facts_of(name: str, effects: Sequence[str]) -> _Facts:
    """Return the facts of a model: of its class, or else of its FMU's description."""
    from fmus.kit import registry
    from orchestration.fmu import find_model, read_description
    from orchestration.fmu.model import find_class, names_class

    if effects or name in registry.models() or names_class(name):
        return _facts_of_class(name, find_class(name, effects))
    model = find_model(name)
    for text in model.notes:
        note(text)
    if model.cls is not None:
        facts = _facts_of_class(name, model.cls)
        declared = [signal.name for signal in facts.signals["outputs"]]
        clocks = [signal for key, signal in model.outputs.items() if key not in declared]
        outputs = [*facts.signals["outputs"], *clocks]
        return facts._replace(signals={**facts.signals, "outputs": outputs})
    described = read_description(model.path)
    step = getattr(described.defaultExperiment, "stepSize", None)
    known = model.with_texts(())
    groups = {
        "inputs": known.inputs,
        "outputs": known.outputs,
        "parameters": known.parameters,
        "others": known.others,
    }
    signals = {group: list(signals.values()) for group, signals in groups.items()}
    return _Facts(name, described.description or "", signals, float(step) if step else None)


def _facts_of_class(name: str, cls: type[Component]) -> _Facts:
    """Return the declarations of a component's class."""
    from orchestration.fmu.model import known_effects
    from orchestration.fmu.signal import declared_signal

    layout = cls.layout
    base, stacked = unstack(cls)
    hidden = {layout.start_of[z.name] for z in layout.discretes if z.is_memory}
    # what an output was before the start belongs to its delay
    delays = [effect for effect in stacked if made_by(effect) is transport_delay]
    hidden |= {start for effect in delays for start in effect.layout.start_of.values()}
    settable = [p for p in layout.parameters if p.name not in hidden]
    groups = {
        "inputs": layout.inputs,
        "outputs": layout.shown,
        "parameters": (*settable, *layout.texts),
    }
    added = [effect_name(effect) for effect in stacked]
    signals = {}
    for group, variables in groups.items():
        signals[group] = [declared_signal(variable) for variable in variables]
    return _Facts(
        name,
        summary=f"{summary(cls)}." if cls.__doc__ else "",
        signals=signals,
        step=cls.experiment[1],
        remarks=cls.remark.splitlines(),
        tolerance=cls.tolerance,
        sources={one.name: one.source for one in layout.parameters if one.source},
        presets={preset: about.doc for preset, about in cls.presets.items()},
        made_from=base.name,
        laid_over=added,
        effects={
            effect: _relaxed_assumption(base, effect)
            for effect_id, effect in known_effects(cls, inputs=True).items()
            if effect_id not in added
        },
    )


def _relaxed_assumption(cls: type[Component], effect: type[Effect]) -> str:
    """Return the assumption of a component that an effect relaxes, with its number if known."""
    from fmus.kit.build import relaxed_assumption

    words, number = relaxed_assumption(cls, effect)
    return f"{words} ({number})" if words and number else words or number


def _as_json(known: _Facts) -> dict[str, Any]:
    """Return the facts of a model in the form that ``--json`` writes."""
    signals = {
        group: [_signal_as_json(signal, known.sources) for signal in members]
        for group, members in known.signals.items()
    }
    return {
        "name": known.name,
        "summary": known.summary,
        **signals,
        "presets": dict(known.presets),
        "made_from": known.made_from or None,
        "with": list(known.laid_over),
        "remarks": list(known.remarks),
        "effects": [
            {
                "name": effect_name(effect),
                "id": effect.id,
                "output": effect.output or None,
                "summary": _first_line(effect),
                "parameter": effect.neutral,
                "relaxes": relaxed,
            }
            for effect, relaxed in known.effects.items()
        ],
        "step": known.step,
        "tolerance": known.tolerance,
    }


def _signal_as_json(signal: Signal, sources: Mapping[str, str]) -> dict[str, Any]:
    """Return the attributes of a signal, with the source of its value if there is one."""
    from dataclasses import asdict

    known = asdict(signal)
    known["start"] = signal.default if signal.declares_start else None
    del known["text"]  # a text begins with its start value
    if signal.name in sources:
        known["source"] = sources[signal.name]
    return known


def _first_line(effect: type[Effect]) -> str:
    return summary(effect).replace("``", "")


def _show(known: _Facts) -> None:
    """Print the facts of a model: summary, signals, sources, presets, effects and step."""
    from rich.text import Text

    from orchestration.fmu.signal import allowed, start_of

    out.print(known.name, style="bold", end="  ")
    out.print(f"{known.summary}\n")
    if known.laid_over:
        out.print(f"made from {known.made_from} with {', '.join(known.laid_over)}\n")
    for remark in known.remarks:
        out.print(f"  {remark}", style="dim")
    for title in ("inputs", "outputs"):
        table = plain_table(title, "name", "unit", "meaning")
        for signal in known.signals[title]:
            unit = allowed(signal) if signal.items or signal.type == "string" else signal.unit
            table.add_row(signal.name, unit, signal.doc)
        out.print(table)
        out.print()
    table = plain_table("parameters", "name", "default", "allowed", "meaning")
    for signal in known.signals["parameters"]:
        meaning = f"{signal.doc}; tunable" if signal.is_tunable else signal.doc
        table.add_row(signal.name, start_of(signal), allowed(signal), meaning)
    out.print(table)
    for source in dict.fromkeys(known.sources.values()):
        names = ", ".join(name for name, other in known.sources.items() if other == source)
        out.print(f"  {names}: {source}", style="dim")
    for preset, about in known.presets.items():
        out.print(Text.assemble("\npreset ", (preset, "cyan"), f": {about}"))
    if known.effects:
        out.print()
        _show_effects(known.effects)
    if known.step is not None:
        accuracy = "" if known.tolerance is None else f"; internal accuracy {known.tolerance:g}"
        out.print(f"\nstep {known.step:g} s by default{accuracy}")


def _show_effects(effects: Mapping[type[Effect], str]) -> None:
    """Print the effects that can be laid over a model, one of a sensor or an input once for all."""
    table = plain_table(
        "effects that --with lays over it, and --effects names as causes",
        "effect",
        "what it is (what the model assumes; what switches it)",
    )
    places: dict[str, dict[str, None]] = {}  # inputs or outputs by the word that stands for them
    shown = set()
    for effect, relaxed in effects.items():
        name, switch, subject = effect_name(effect), effect.neutral, _subject(effect)
        if subject:
            place = "OUTPUT" if effect.output else "INPUT"
            name = f"{effect.id}({place})"
            switch = switch.replace(subject, place)
            relaxed = relaxed.replace(subject, place)
            places.setdefault(place, {})[subject] = None
        if name not in shown:
            table.add_row(name, f"{_first_line(effect)} ({relaxed}; {switch})")
        shown.add(name)
    out.print(table)
    for place, subjects in places.items():
        out.print(f"  {place} is one of {', '.join(subjects)}", style="dim")


def _subject(effect: type[Effect]) -> str:
    """Return the output or the input for which an effect was made; empty for one of a law."""
    made_for_input = effect.term.qualifier == effect.term.signal and not effect.term.law
    return effect.output or (effect.term.signal if made_for_input else "")
