"""A diagnosis in words: the verdict in one sentence, what an effect does, and why one was not named."""

from __future__ import annotations

import math
import re

from fmus.kit import Effect
from fmus.kit.units import Described, shown
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.selection.stepwise import ACCEPT
from orchestration.identify.grey_box import Estimate
from orchestration.reporting.page import Markup, escaped

_VAGUE = 1e4  # times its lower end, beyond which an interval tells nothing
_SENTENCES = {
    "consistent": "The model is consistent with the record: nothing is wrong beyond noise.",
    "recalibrate": "The structure of the model is fine; parameters differ from nominal: {differing}.",
    "cause": "What the model gets wrong: {causes}.",
    "ambiguous": "Something is wrong that this record cannot tell apart: {causes}.",
    "unexplained": "{beside} is left that nothing in the catalogue accounts for: {left}.",
}


def sentence(found: Diagnosis) -> str:
    """The verdict in one sentence."""
    if found.verdict == "ambiguous" and not found.causes:
        return "This record cannot tell whether anything is wrong: no input moves."
    left = []
    for output, rest in found.left.items():
        left += [f"a line at {line.frequency:.3g} Hz in {output}" for line in rest.lines[:1]]
        left += [f"{len(rest.jumps)} {'jump' if len(rest.jumps) == 1 else 'jumps'} of {output}"] if rest.jumps else []
        left += [text.replace("it ", f"{output} ", 1) for text in rest.texts[:1]]
    left += [note for note in found.notes if note.startswith("out of all reason")]
    words = {
        "differing": ", ".join(found.differing), "causes": _causes(found),
        "left": "; ".join(left), "beside": f"Beside {_causes(found)}, something" if found.causes else "Something",
    }  # fmt: skip
    return _SENTENCES[found.verdict].format(**words)


def _causes(found: Diagnosis) -> str:
    """Name the effects with what cannot be told apart from them, and which are much weaker than the first."""
    steps = found.selection.steps
    named = [" or ".join(e.last for e in (step.chosen, *step.rivals)) for step in steps]
    strong = [name for name, step in zip(named, steps, strict=True) if step in found.selection.strong]
    weak = [name for name in named if name not in strong]
    return "; ".join(strong) + (f"; and, much weaker, {', '.join(weak)}" if weak else "")


def does(effect: type[Effect]) -> Markup:
    """What an effect does, from the first line of its doc, and which assumption it relaxes."""
    first = escaped((effect.__doc__ or "").strip().split("\n")[0].rstrip("."))
    text = re.sub(r"``(.+?)``", r"<code>\1</code>", first)
    about = effect.assumption
    relaxes = f"assumption {about}" if isinstance(about, int) else escaped(about)
    return Markup(text + (f"; relaxes {relaxes}" if relaxes else ""))


def why_not(gains: list[float], named: str) -> str:
    """Why an effect was not named.

    Parameters
    ----------
    gains : list of float
        Fall of BIC that it brought, in the first look and in every later one.
    named : str
        What was found before the last look.
    """
    if len(gains) > 1 and gains[0] > ACCEPT >= gains[-1]:
        return f"alone it lowers BIC by {gains[0]:.1f}; beside {named} it is not needed"
    if gains[-1] > ACCEPT:
        return "another explains the record much better"
    if gains[-1] > 0.0:
        return f"too little: {ACCEPT:g} would be evidence"
    return "it explains less than its parameters cost"


def probability(p: float) -> Markup:
    """Return a small probability as people write it."""
    if p >= 1e-3:
        return Markup(f"{p:.2g}")
    if p == 0.0:
        return Markup("&lt; 10<sup>−300</sup>")
    return pretty(f"{p:.1e}")


def pretty(text: str) -> Markup:
    """Return values with units as they are printed: 2·10⁶ N·s/m for ``2e+06 N*s/m``."""
    text = escaped(text).replace("*", "·")
    text = re.sub(
        r"(?<=\d)e([+-])0*(\d+)", lambda m: f"·10<sup>{m[1].replace('+', '').replace('-', '−')}{m[2]}</sup>", text
    )
    text = re.sub(r"(?<![\w.])-(?=\d)", "−", text)
    return Markup(re.sub(r"\^([-−]?\d+)", lambda m: f"<sup>{m[1].replace('-', '−')}</sup>", text))


def change(e: Estimate) -> str:
    """By how much a value differs from nominal; nothing where that is zero."""
    return pretty(f"{100.0 * (e.value / e.nominal - 1.0):+.1f} %") if e.nominal else ""


def estimate(e: Estimate, declared: Described) -> tuple[Markup, Markup, Markup]:
    """Value, ends of the interval and nominal value, with as many digits as the interval gives meaning to."""
    half = 0.5 * (e.interval[1] - e.interval[0])
    known = math.log10(abs(e.value) / half) if e.value and 0.0 < half < math.inf else 0.0
    digits = min(max(math.ceil(known) + 2, 3), 8)
    interval = "the record does not tell"
    low, high = e.interval
    if math.isfinite(low) and math.isfinite(high) and not 0.0 < _VAGUE * low < high:
        unit = f" {declared.display or declared.unit}"
        interval = " … ".join(shown(end, declared, digits).removesuffix(unit) for end in e.interval)
    return pretty(shown(e.value, declared, digits)), pretty(interval), pretty(shown(e.nominal, declared))


def details(found: Diagnosis) -> list[Markup]:
    """What a verdict is about, in a few lines: what the effects do, or by how much parameters differ."""
    lines = []
    for step in found.selection.steps:
        for evidence in (step.chosen, *step.rivals):
            lines.append(Markup(f"<b>{escaped(evidence.last)}</b>: {does(evidence.effect)}"))
    if found.verdict == "recalibrate":
        for name in found.differing:
            e, declared = found.estimates[name], found.selection.best.problem.declared[name]
            value, _, nominal = estimate(e, declared)
            more = f" ({change(e)})" if e.nominal else ""
            text = f"<b>{escaped(name)}</b>: {value} instead of {nominal}{more}; {escaped(declared.doc)}"
            lines.append(Markup(text))
    return lines
