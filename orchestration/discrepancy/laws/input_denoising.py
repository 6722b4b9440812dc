"""Denoising of inputs: white noise that was measured, but that the plant did not see.

A correction may undo what such noise does to a model, by smoothing it, and would be taken for what
the model lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.selection import denoised, noisy_inputs, unfollowed_noise


def noise_of_inputs(diagnosis: Diagnosis) -> dict[str, float]:
    """Return the standard deviation of input noise that the outputs do not follow, by input, SI."""
    search = search_of(diagnosis)
    noise = noisy_inputs(search.base, search.data)
    return unfollowed_noise(search, diagnosis.selection.best, noise) if noise else {}


def with_denoised_inputs(
    diagnosis: Diagnosis,
    noise: Mapping[str, float],
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Return a diagnosis with its models fitted to inputs without noise, and otherwise the same.

    Parameters
    ----------
    diagnosis : Diagnosis
    noise : Mapping of str to float
        Of `noise_of_inputs`.
    progress : callable
        Told what is being done.

    Raises
    ------
    UserError
        If a model cannot be simulated with these inputs.
    """
    estimation = denoised(diagnosis.estimation, noise)
    validation = diagnosis.validation
    selection = diagnosis.selection
    search = replace(search_of(diagnosis, progress), data=estimation)
    steps = [replace(step, chosen=search.refit(step.chosen)) for step in selection.steps]
    whole = replace(search, data=denoised(diagnosis.usable, noise))
    return replace(
        diagnosis,
        estimation=estimation,
        validation=replace(validation, data=denoised(validation.data, noise)),
        selection=replace(selection, base=search.refit(selection.base), steps=steps),
        final=whole.refit(diagnosis.final),
    )
