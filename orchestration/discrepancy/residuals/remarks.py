"""What is worth telling of a residual although it is no fault of a model: outliers, varying noise, feedback."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.residuals.analysis import ALPHA, ResidualAnalysis

_NOTED = 1.5  # times the level elsewhere, below which noise is as good as even


def remarks(residuals: Mapping[str, ResidualAnalysis]) -> Iterator[Note]:
    """Notes on what is left.

    Parameters
    ----------
    residuals : Mapping of str to ResidualAnalysis
        By output.

    Yields
    ------
    Note
    """
    for output, analysis in residuals.items():
        if analysis.outliers:
            facts = {"count": analysis.outliers, "share": analysis.outliers / analysis.samples}
            yield Note(NoteCode.OUTLYING_RESIDUALS, output, facts)
        varying = [r for r in analysis.regions if r.p_value < ALPHA and r.rms_ratio > _NOTED]
        if varying and not analysis.structure and max(r.rms for r in varying) > analysis.rounding:
            worst = max(varying, key=lambda region: region.rms_ratio)
            yield Note(
                NoteCode.VARYING_NOISE, output, {"ratio": worst.rms_ratio, "signal": worst.signal}
            )
        for one in [f for f in analysis.feedback if f.p_value < ALPHA][:1]:
            yield Note(
                NoteCode.FEEDBACK,
                output,
                {"input": one.input, "strength": one.strength, "lag": one.lag},
            )
