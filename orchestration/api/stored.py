"""Diagnoses in files of JSON: stamped with product and format, and shown again as they were."""

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
from orchestration.reporting import Displayable, in_shell, one_line, write_page

if TYPE_CHECKING:
    from rich.console import RenderableType

FORMAT = 1  # of the file; another one where a field is no longer what it was
_STAMP = "format"


def stamped(figures: Mapping[str, Any], shown: DiagnosisView | SystemView) -> dict[str, Any]:
    """Return the figures of a diagnosis as a file has them.

    Parameters
    ----------
    figures : Mapping of str to object
    shown : DiagnosisView or SystemView
        What people are shown of it.
    """
    product = f"ppy-rig {version('ppy-rig')}"
    view = shown.model_dump(mode="json")
    return {_STAMP: FORMAT, "product": product, **figures, "shown": view}


def view_overview(shown: DiagnosisView | SystemView) -> list[RenderableType]:
    """Return the renderables that the command prints."""
    if isinstance(shown, SystemView):
        return [overview(shown)]
    parts: list[RenderableType] = [terminal.overview(shown.answer)]
    if shown.changes is not None:
        parts.append(terminal.comparison(shown.changes))
    if shown.laws is not None:
        parts.append(terminal.laws(shown.laws))
    return parts


class StoredDiagnosis(Displayable):
    """A diagnosis from a file: what terminal and page showed of it, and its figures.

    Parameters
    ----------
    shown : DiagnosisView or SystemView
    figures : Mapping of str to object
        All of the file.
    source : Path

    Attributes
    ----------
    verdict : str
    """

    def __init__(
        self, shown: DiagnosisView | SystemView, figures: Mapping[str, Any], source: Path
    ) -> None:
        self._shown = shown
        self._figures = figures
        self._source = source
        self.verdict = shown.verdict if isinstance(shown, SystemView) else shown.answer.verdict

    def overview(self) -> list[RenderableType]:
        """Return the renderables that the command printed."""
        return view_overview(self._shown)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as they are in the file."""
        return dict(self._figures)

    def report(self, path: str | Path) -> Path:
        """Write the page of HTML that was made with it.

        Parameters
        ----------
        path : str or Path
            An ``.html`` file.

        Raises
        ------
        UserError
            If the page cannot be written, or its name does not end in ``.html``.
        """
        with in_shell():
            return write_page(self._shown, path)

    def __repr__(self) -> str:
        return one_line(f"StoredDiagnosis {self.verdict}: {self._source}")


def read_diagnosis(path: str | Path) -> StoredDiagnosis:
    """Read a diagnosis that ``--json`` or `to_dict` wrote, to show it again.

    Parameters
    ----------
    path : str or Path
        A ``.json`` file.

    Returns
    -------
    StoredDiagnosis

    Raises
    ------
    UserError
        If the file cannot be read, is no diagnosis, or has a format of another version.

    Examples
    --------
    >>> import json
    >>> from pathlib import Path
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "right.csv")
    >>> result = ppy.diagnose("right.csv", effects=[])
    >>> _ = Path("right.json").write_text(json.dumps(result.to_dict()))
    >>> ppy.read_diagnosis("right.json").verdict == result.verdict
    True
    """
    source = Path(path)
    try:
        figures = json.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{source}: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"{source}: this is no JSON: {error}") from error
    if not isinstance(figures, dict) or _STAMP not in figures:
        raise UserError(
            f"{source}: it has no format: it is no diagnosis, or one of before diagnoses were"
            " stamped; diagnose the record again"
        )
    if figures[_STAMP] != FORMAT:
        raise UserError(
            f"{source}: format {figures[_STAMP]!r} of {figures.get('product', 'another product')}"
            f" is not known; ppy-rig {version('ppy-rig')} reads format {FORMAT}"
        )
    shown = figures.get("shown")
    kind = SystemView if "system" in figures else DiagnosisView
    try:
        return StoredDiagnosis(kind.model_validate(shown), figures, source)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, ("shown", *first["loc"])))
        raise UserError(f"{source}: {place}: {first['msg'].lower()}") from error
