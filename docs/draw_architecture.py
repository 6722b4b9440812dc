"""Draw the layers: boxes in floors as import-linter has them, arrows as the code imports.

``python docs/draw_architecture.py`` writes the pictures anew: plain SVG, the same bytes wherever it
is drawn.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
BOX, GAP, FLOOR, EDGE = (158, 34), 16, 86, 24  # width and height of a box, and distances, in pixels
_HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}"'
    ' role="img" font-family="system-ui, sans-serif"'
    ' font-size="13"><title>{title}</title><defs><marker id="tip" viewBox="0 0 8 8" refX="8"'
    ' refY="4" markerWidth="7" markerHeight="7" orient="auto"><path d="M0 0 8 4 0 8z"'
    ' fill="context-stroke"/></marker></defs><rect width="{w}" height="{h}" fill="#fff"/>'
)

# to parse the whole of each source takes ten times as long
_TEXT = re.compile(r"(\"{3}|'{3}).*?\1", re.S)
_IMPORT = re.compile(r"^ *((?:from [.\w]+ )?import (?:\([^)]*\)|.*))", re.M)


@dataclass(frozen=True)
class Plan:
    """A picture of rooms and the imports between them.

    Attributes
    ----------
    title : str
    container : str
        Package of which the boxes are parts; empty where a box is named in full.
    floors : list of list of str
        Boxes from the highest floor down.
    arrows : set of tuple of str
        Who imports whom.
    """

    title: str
    container: str
    floors: list[list[str]]
    arrows: set[tuple[str, str]]

    def direct(self) -> set[tuple[str, str]]:
        """Arrows that no chain of others stands for."""
        reached = {
            box: {b for a, b in self.arrows if a == box} for floor in self.floors for box in floor
        }
        for floor in reversed(self.floors):  # from below, so that what is below has been gathered
            for box in floor:
                reached[box] |= {far for near in reached[box] for far in reached[near]}
        return {
            (a, b)
            for a, b in self.arrows
            if not any(b in reached[c] for s, c in self.arrows if s == a and c != b)
        }


def layers(container: str) -> list[list[str]]:
    """Floors of a package, from the contract of import-linter on it."""
    settings: Any = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]
    (contract,) = (
        c
        for c in settings["contracts"]
        if c["type"] == "layers" and c.get("containers") == [container]
    )
    return [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]


def import_statements(text: str) -> list[ast.stmt]:
    """Return the imports of a source, wherever in it they stand."""
    return ast.parse("\n".join(_IMPORT.findall(_TEXT.sub("", text)))).body


def imports(path: Path, root: Path = ROOT) -> Iterator[str]:
    """Modules, or names in them, that a module imports, wherever in it the import stands."""
    package = path.relative_to(root).parent.parts
    for level, name in _named(path.read_text(encoding="utf-8")):
        above = package[: len(package) + 1 - level] if level else ()
        yield ".".join((*above, name))


@cache
def _named(text: str) -> list[tuple[int, str]]:
    """List what a source imports, and the number of packages up to which it is relative."""
    found: list[tuple[int, str]] = []
    for node in import_statements(text):
        if isinstance(node, ast.Import):
            found += [(0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [
                (node.level, ".".join(filter(None, (node.module, alias.name))))
                for alias in node.names
            ]
    return found


def arrows(boxes: dict[str, str]) -> set[tuple[str, str]]:
    """Return the pairs of boxes of which the first imports the second.

    Parameters
    ----------
    boxes : dict of str to str
        Name of each box by the module or package that it stands for; a module belongs to the
        nearest above it.
    """

    def box(module: str) -> str | None:
        parts = module.split(".")
        return next(
            (boxes[m] for n in range(len(parts), 0, -1) if (m := ".".join(parts[:n])) in boxes),
            None,
        )

    found = set()
    for path in sorted(
        p for folder in ("fmus", "orchestration") for p in (ROOT / folder).rglob("*.py")
    ):
        here = box(".".join(path.relative_to(ROOT).with_suffix("").parts))
        found |= {
            (here, there)
            for module in imports(path)
            if here and (there := box(module)) and here != there
        }
    return found


def plans() -> dict[str, Plan]:
    """Every picture by the name of its file."""
    rooms, floors = layers("orchestration"), layers("orchestration.diagnosis")
    parts = sorted(
        p.parent.name for p in (ROOT / "fmus").glob("*/__init__.py") if p.parent.name != "kit"
    )
    models = [f"fmus.{name}" for name in parts]
    boxes = {f"orchestration.{room}": room for floor in rooms for room in floor}
    boxes |= {name: name for name in ("fmus", "fmus.kit", *models)}
    inside = {f"orchestration.diagnosis.{room}": room for floor in floors for room in floor}
    rig = layers("orchestration.rig")
    at_the_rig = {f"orchestration.rig.{room}": room for floor in rig for room in floor}
    return {
        "layers.svg": Plan(
            "Rooms of the project", "", [*rooms, ["fmus", *models], ["fmus.kit"]], arrows(boxes)
        ),
        "layers_of_a_diagnosis.svg": Plan(
            "orchestration.diagnosis", "orchestration.diagnosis", floors, arrows(inside)
        ),
        "layers_of_a_rig.svg": Plan(
            "orchestration.rig", "orchestration.rig", rig, arrows(at_the_rig)
        ),
    }


def places(plan: Plan) -> dict[str, tuple[float, float]]:
    """Place the middle of every box.

    Floors but the widest stand left and right in turn, so that long arrows pass by boxes.
    """
    pitch, high, widest = BOX[0] + GAP, BOX[1], max(map(len, plan.floors))
    at, side = {}, 1.0
    for k, floor in enumerate(plan.floors):
        shift = 0.0 if len(floor) == widest else side * (0.6 if len(floor) == 1 else 0.25) * pitch
        side = -side if shift else side
        for i, box in enumerate(floor):
            x = EDGE + shift + (i + 0.5 + (widest - len(floor)) / 2.0) * pitch
            at[box] = x, EDGE + k * FLOOR + high / 2.0
    return at


def arrow(start: tuple[float, float], end: tuple[float, float], style: str) -> str:
    """Draw an arrow from the lower edge of a box to the upper edge of another."""
    room = BOX[0] / 2.0 - 14.0
    lean = max(-room, min(room, 0.25 * (end[0] - start[0])))
    x0, y0, x1, y1 = start[0] + lean, start[1] + BOX[1] / 2.0, end[0] - lean, end[1] - BOX[1] / 2.0
    bend = (y1 - y0) / 2.0
    way = f"M{x0:.0f} {y0:.0f}C{x0:.0f} {y0 + bend:.0f} {x1:.0f} {y1 - bend:.0f} {x1:.0f} {y1:.0f}"
    return f'<path d="{way}" fill="none" {style} marker-end="url(#tip)"/>'


def svg(plan: Plan) -> str:
    """Draw a plan."""
    at, direct, (wide, high) = places(plan), plan.direct(), BOX
    size = (
        max(x for x, _ in at.values()) + wide / 2 + EDGE,
        max(y for _, y in at.values()) + high / 2 + EDGE,
    )
    parts = [_HEAD.format(w=round(size[0]), h=round(size[1]), title=plan.title)]
    for pair in sorted(
        plan.arrows, key=lambda pair: (pair in direct, pair)
    ):  # the direct ones on top
        style = 'stroke="#33658a" stroke-width="1.4"' if pair in direct else 'stroke="#c9d6df"'
        parts.append(arrow(at[pair[0]], at[pair[1]], style))
    for box, (x, y) in at.items():
        fill = "#f6f1e7" if box.startswith("fmus") else "#eef4f8"
        name = box if box in ("fmus", "fmus.kit") else box.removeprefix("fmus.")
        parts.append(
            f'<rect x="{x - wide / 2:.0f}" y="{y - high / 2:.0f}" width="{wide}" height="{high}"'
            f' rx="5" fill="{fill}" stroke="#33658a"/><text x="{x:.0f}" y="{y + 4.5:.0f}"'
            f' text-anchor="middle">{name}</text>'
        )
    return "\n".join([*parts, "</svg>\n"])


if __name__ == "__main__":
    for file, plan in plans().items():
        (PICTURES / file).write_text(svg(plan), encoding="utf-8")
