"""Effects, values and probabilities as a page prints them."""

from __future__ import annotations

import math
import re

from fmus.kit import Effect
from fmus.kit.units import Described, shown
from orchestration.discrepancy.diagnosis import Diagnosis, Verdict
from orchestration.identify.estimate import Estimate
from orchestration.reporting.page import Markup, escaped

_VAGUE = 1e4  # times its lower end, beyond which an interval tells nothing


def does(effect: type[Effect]) -> Markup:
    """What an effect does, from the first line of its doc, and which assumption it relaxes."""
    first = escaped((effect.__doc__ or "").strip().split("\n")[0].rstrip("."))
    text = re.sub(r"``(.+?)``", r"<code>\1</code>", first)
    about = effect.assumption
    relaxes = f"assumption {about}" if isinstance(about, int) else escaped(about)
    return Markup(text + (f"; relaxes {relaxes}" if relaxes else ""))


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
        r"(?<=\d)e([+-])0*(\d+)",
        lambda m: f"·10<sup>{m[1].replace('+', '').replace('-', '−')}{m[2]}</sup>",
        text,
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
    return (
        pretty(shown(e.value, declared, digits)),
        pretty(interval),
        pretty(shown(e.nominal, declared)),
    )


def details(diagnosis: Diagnosis) -> list[Markup]:
    """What a verdict is about, in a few lines: what the effects do, or by how much parameters differ."""
    lines = []
    for step in diagnosis.selection.steps:
        for alternative in (step.chosen, *step.alternatives):
            lines.append(
                Markup(f"<b>{escaped(alternative.effect_name)}</b>: {does(alternative.effect)}")
            )
    if diagnosis.verdict is Verdict.RECALIBRATE:
        for name in diagnosis.changed:
            e, declared = diagnosis.estimates[name], diagnosis.final.problem.declared[name]
            value, _, nominal = estimate(e, declared)
            more = f" ({change(e)})" if e.nominal else ""
            text = f"<b>{escaped(name)}</b>: {value} instead of {nominal}{more}; {escaped(declared.doc)}"
            lines.append(Markup(text))
    return lines
