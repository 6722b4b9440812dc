"""Results from files of JSON, shown again as they were: ``ppy.load``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from fmus.kit import UserError
from orchestration.diagnosis import DiagnosisView
from orchestration.diagnosis.report import terminal
from orchestration.diagnosis.systems import SystemView, overview
from orchestration.reporting import Displayable, make_page, one_line, saving
from orchestration.reporting.html import Page

if TYPE_CHECKING:
    from rich.console import RenderableType


def view_overview(shown: DiagnosisView | SystemView | saving.Shown) -> list[RenderableType]:
    """Return the renderables that the command prints."""
    if isinstance(shown, saving.Shown):
        return [shown.text]
    if isinstance(shown, SystemView):
        return [overview(shown)]
    return terminal.parts(shown.answer, shown.changes, shown.laws)


class StoredResult(Displayable):
    """A result from a file: what text and page showed of it, and its figures.

    Parameters
    ----------
    shown : DiagnosisView, SystemView or saving.Shown
    figures : Mapping of str to object
        All of the file.
    source : Path

    Attributes
    ----------
    verdict : str
        Of a diagnosis; else empty.
    """

    def __init__(
        self,
        shown: DiagnosisView | SystemView | saving.Shown,
        figures: Mapping[str, Any],
        source: Path,
    ) -> None:
        self._shown = shown
        self._figures = figures
        self._source = source
        about = shown.answer if isinstance(shown, DiagnosisView) else shown
        self.verdict: str = getattr(about, "verdict", "")

    def overview(self) -> list[RenderableType]:
        """Return the renderables that the command printed."""
        return view_overview(self._shown)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as they were."""
        figures: Mapping[str, Any] = self._figures
        if isinstance(self._shown, saving.Shown):
            figures = figures["figures"]
        return dict(figures)

    def _kept(self) -> dict[str, Any]:
        return dict(self._figures)

    def __repr__(self) -> str:
        if isinstance(self._shown, saving.Shown):
            return self._shown.line
        return one_line(f"StoredResult {self.verdict}: {self._source}")


@make_page.register(StoredResult)
def stored_page(result: StoredResult, command: str = "") -> Page:
    """Make the page of a result from its file; UserError if it had none."""
    return make_page(result._shown)


def load(path: str | Path) -> StoredResult:
    """Read a result that its ``save`` or the option ``--json`` of `diagnose` wrote.

    Parameters
    ----------
    path : str or Path
        A ``.json`` file.

    Returns
    -------
    StoredResult
        It prints as the result did; ``to_dict`` has its figures, and ``report`` writes its page.

    Raises
    ------
    UserError
        If the file cannot be read, is no result, or has a format of another version.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "right.csv")
    >>> fitted = ppy.fit("right.csv", "ppy_actuator", ["R1", "C"])
    >>> str(ppy.load(fitted.save("fitted.json"))) == str(fitted)
    True
    """
    source = Path(path)
    try:
        figures = json.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{source}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{source}: this is no JSON: {error}") from error
    if not isinstance(figures, dict) or saving.STAMP not in figures:
        raise UserError(
            f"{source}: it has no format: it is no result, or one of before results were stamped;"
            " save it again"
        )
    form = figures[saving.STAMP]
    if form != saving.FORMAT:
        raise UserError(
            f"{source}: format {form!r} of {figures.get('product', 'another product')}"
            f" is not known; ppy-rig {version('ppy-rig')} reads format {saving.FORMAT}"
        )
    try:
        return StoredResult(_kind(figures).model_validate(figures.get("shown")), figures, source)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, ("shown", *first["loc"])))
        raise UserError(f"{source}: {place}: {first['msg'].lower()}") from error


def _kind(figures: Mapping[str, Any]) -> type[DiagnosisView | SystemView | saving.Shown]:
    """Return the form of what is shown of the result in a file."""
    if isinstance(figures.get("figures"), dict):
        return saving.Shown
    return SystemView if "system" in figures else DiagnosisView
