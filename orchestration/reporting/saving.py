"""Files of results: JSON with the figures of a result, and with all that people are shown of it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from fmus.kit import UserError, files
from orchestration.reporting.drawing import make_page, registered
from orchestration.reporting.html import Page

FORMAT = 1  # of files; another one where a field is no longer what it was
STAMP = "format"
_NUMBERS = re.compile(r"\[\n\s+(?:(?:-?\d[\d.eE+-]*|null),?\n\s+)+\]")


class ShownPage(BaseModel):
    """The page of a result: its title and its elements, without style.

    Attributes
    ----------
    title : str
    parts : list of str
        In HTML.
    """

    model_config = ConfigDict(extra="forbid")

    title: str
    parts: list[str]


class Shown(BaseModel):
    """Displays of a result that are saved with it.

    Attributes
    ----------
    kind : str
        Name of its class.
    line, text : str
        Its `repr`, and what it prints.
    page : ShownPage or None
        None of a result without a page.
    """

    model_config = ConfigDict(extra="forbid")

    kind: str
    line: str
    text: str
    page: ShownPage | None


@make_page.register(Shown)
def shown_page(shown: Shown, command: str = "") -> Page:
    """Make the page of a result from its file; UserError if it had none."""
    if shown.page is None:
        raise UserError(f"{shown.kind}: this has no page")
    page = Page(shown.page.title, "")  # which runs no script whatever its elements are
    page.parts = shown.page.parts
    return page


def stamped(figures: Mapping[str, Any], shown: BaseModel) -> dict[str, Any]:
    """Return figures, and what is shown of them, as a file has them."""
    product = f"ppy-rig {version('ppy-rig')}"
    return {STAMP: FORMAT, "product": product, **figures, "shown": shown.model_dump(mode="json")}


def kept(result: Any) -> dict[str, Any]:
    """Return what a file has of any result that prints."""
    shown = Shown(
        kind=type(result).__name__, line=repr(result), text=str(result), page=_page_of(result)
    )
    return stamped({"figures": _figures_of(result)}, shown)


def _figures_of(result: Any) -> dict[str, Any]:
    """Return the figures of a result: its own, those of its table, or none."""
    if hasattr(result, "to_dict"):
        figures: dict[str, Any] = result.to_dict()
        return figures
    return result.to_frame().to_dict("split") if hasattr(result, "to_frame") else {}


def _page_of(result: Any) -> ShownPage | None:
    """Return the page of a result, as the command writes it; None if it has none."""
    try:
        registered(make_page, type(result), "page")
    except UserError:
        return None
    page = make_page(result)
    return ShownPage(title=page.title, parts=[*map(str, page.parts)])


def json_text(data: Any) -> str:
    """Return data as JSON, a row of numbers on a line; numbers that are not finite become null.

    Parameters
    ----------
    data : object
        Dictionaries, lists, texts, numbers, arrays and None.
    """
    text = json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"
    return _NUMBERS.sub(lambda numbers: " ".join(numbers[0].split()), text)


def save(data: Mapping[str, Any], path: str | Path) -> Path:
    """Write what a file has of a result.

    Raises
    ------
    UserError
        If it cannot be written, or its name does not end in ``.json``.
    """
    target = Path(path)
    if target.suffix.lower() != ".json":
        raise UserError(f"{target}: the name of a result's file ends in .json")
    files.write(target, json_text(data).encode())
    return target


def _finite(data: Any) -> Any:
    """Return data with None in place of numbers that JSON does not have."""
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if hasattr(data, "tolist"):
        return _finite(data.tolist())
    return None if isinstance(data, float) and not math.isfinite(data) else data
