"""Chapter 2, the bench without its force loop: converters, filters, galvanostat of table 2-2."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot

from demonstrations.thesis import loop_analysis as analysis
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.galvanostat import Galvanostat
from fmus.kit import Integrator
from fmus.kit.units import convert
from fmus.voice_coil_dma import VoiceCoilDma

_DMA = {p.name: float(p.start) for p in VoiceCoilDma.layout.parameters}
_A1_CUTOFF = _DMA["force_cutoff"]
_DESCRIBED_CUTOFF = VoiceCoilDma.presets["as_described"].values["force_cutoff"]
_NYQUIST = 0.5 / analysis.SAMPLE_PERIOD


def entries() -> Iterator[Entry]:
    """Yield claims and errata about the instruments."""
    for part in (_instruments, _resolution, _filters, _galvanostat):
        yield from part()


def illustrations() -> tuple[Illustration, ...]:
    """Return an empty tuple, as the figures are photographs and drawings."""
    return ()


def _instruments() -> Iterator[Entry]:
    for what, published, value, unit, to in (
        ("continuous force of the coil, 1.1 lbf", "4.9", 1.1, "lbf", "N"),
        ("stroke of the coil, 0.5 in", "12.7", 0.5, "in", "mm"),
        ("stroke of the potentiometer, 2 in", "50.8", 2.0, "in", "mm"),
        ("range of the load cell, 10 lbf", "44.5", 10.0, "lbf", "N"),
    ):
        yield Claim("section 2.2.2", what, published, float(convert(value, unit, to)), to)
    largest = _DMA["voltage_max"] * _DMA["K"] / _DMA["R"]
    yield Claim("table 2-1", "force that 10 V can give", "≥3", largest, "N", "K/R times 10 V")


def _resolution() -> Iterator[Entry]:
    step = 2.0 * _DMA["converter_range"] / 2.0 ** _DMA["converter_bits"]
    position = convert(step / _DMA["potentiometer_sensitivity"], "m", "mm")
    about = "16 bits over the stroke of the potentiometer"
    yield Claim(
        "section 2.2.2", "resolution of the position", "<0.003", float(position), "mm", about
    )


def _filters() -> Iterator[Entry]:
    hum = 60.0  # Hz, in the country of the thesis
    folded = abs(hum - 2.0 * _NYQUIST * round(hum / (2.0 * _NYQUIST)))
    remaining, humming = (
        {cutoff: 1.0 / hypot(1.0, frequency / cutoff) for cutoff in (_DESCRIBED_CUTOFF, _A1_CUTOFF)}
        for frequency in (_NYQUIST, hum)
    )
    cutoff = Claim(
        "section 2.2.2",
        "cutoff of the sensor filters, against A1",
        f"{_DESCRIBED_CUTOFF:g}",
        _A1_CUTOFF,
        "Hz",
        f"A1's filter leaves {100 * remaining[_A1_CUTOFF]:.1f} % at half the sampling frequency",
        erratum=5,
    )
    yield cutoff
    yield Erratum(
        5,
        "section 2.2.2 against A1",
        f"sensor filters at about {cutoff.published} Hz",
        f"A1 designs with {_A1_CUTOFF:g} Hz. At {_NYQUIST:g} Hz, half the sampling frequency, the"
        f" one leaves {100 * remaining[_DESCRIBED_CUTOFF]:.0f} % of a disturbance, the other"
        f" {100 * remaining[_A1_CUTOFF]:.0f} %; of {hum:g} Hz hum, which {2 * _NYQUIST:g} Hz"
        f" sampling folds to {folded:g} Hz, {100 * humming[_DESCRIBED_CUTOFF]:.0f} % and"
        f" {100 * humming[_A1_CUTOFF]:.0f} %",
    )
    yield Claim(
        "section 2.2.3", "sampling period at 30 Hz", "33", 1e3 * analysis.SAMPLE_PERIOD, "ms"
    )


def _galvanostat() -> Iterator[Entry]:
    saturated = Galvanostat(current_command=1e3)
    yield Claim(
        "table 2-2",
        "largest current",
        "1.3",
        float(saturated.outputs()[0]),
        "A",
        "component asked for more",
    )
    resistance = 100.0
    driver = Galvanostat(current_command=1.0, voltage_limit=1e3)
    integrator = Integrator(driver)
    for k in range(200):  # into a resistance too large for the current
        driver.voltage = resistance * driver.outputs()[0]
        integrator.advance(0.01 * k, 0.01)
    yield Claim(
        "table 2-2",
        "largest voltage",
        "15",
        resistance * float(driver.outputs()[0]),
        "V",
        "into 100 Ω",
    )
