"""A model as commands open it: found, built if need be, and with the user told what there is to know of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit.errors import UserError
from orchestration.reporting.console import detail, note, progress, warn

if TYPE_CHECKING:
    from orchestration.fmu.model import Model


def model_file(name: str) -> Path | None:
    """File that a model is read from; None for a component of ours."""
    from fmus import MODELS
    from orchestration.fmu.model import names_class

    if name in MODELS:
        return None
    return Path(name.rpartition(":")[0]) if names_class(name) else Path(name)


def open_model(name: str, runtime: str = "native", effects: Sequence[str] = ()) -> Model:
    """Find a model; see :func:`orchestration.fmu.model.find_model`.

    Raises
    ------
    UserError
        If there is none, or it cannot be built.
    """
    from fmus import MODELS
    from orchestration.fmu.model import find_model, names_class

    with progress() as tell:
        if effects or name in MODELS or names_class(name):
            over = f" with {', '.join(effects)}" if effects else ""
            tell(f"building {name}{over} ({runtime}) unless it is there")
        model = find_model(name, runtime, effects)
    for text in model.notes:
        note(text)
    detail(f"{model.title}: {model.path}")
    return model


def check_inputs(model: Model, signals: Collection[str], parameters: Collection[str]) -> None:
    """Refuse inputs that are given twice; tell which inputs no file and no setting gives.

    Parameters
    ----------
    model : Model
    signals : collection of str
        What the record has.
    parameters : collection of str
        What is set.

    Raises
    ------
    UserError
    """
    from fmus.kit.units import shown

    for name, signal in model.inputs.items():
        if name in signals and name in parameters:
            raise UserError(
                f"--set {name}: the record has a column for it; leave out one of the two"
            )
        if name not in signals and name not in parameters:
            warn(f"no values for the input {name}; it stays at {shown(signal.start, signal)}")


def note_neutral(model: Model, parameters: Collection[str]) -> None:
    """Tell which effects a fit starts without: from the value that switches an effect off it may not find away.

    Parameters
    ----------
    model : Model
    parameters : collection of str
        What is set.
    """
    from fmus.kit.component import effect_name

    if model.cls is None or not model.effects:
        return
    for effect in vars(model.cls)["stacked"][1]:
        if effect_name(effect) in model.effects and effect.neutral not in parameters:
            start = f"{effect.neutral} = {model.parameters[effect.neutral].start:g}"
            note(
                f"a fit starts from {start}, without {effect_name(effect)}; --set starts it elsewhere"
            )
