"""A system with members of FMI 2.0 and 3.0, which only describe themselves."""

from __future__ import annotations

from pathlib import Path

from orchestration.system import Member, Port, System, connect
from tests.support.fmi3_fmus import description, pack, wide_body
from tests.support.system.samples import tiny_fmu


def mixed(folder: Path) -> System:
    """All types, arrays that are connected whole or by an element, values of each kind."""

    def described(name: str, body: str | None = None) -> Path:
        files: dict[str, bytes | str] = {"modelDescription.xml": description(name, body)}
        return pack(folder / f"{name}.fmu", files)

    old = tiny_fmu(folder / "old.fmu", "output count Integer", "parameter gain Real")
    wide = described("wide", wide_body(2))
    values: dict[str, float | str] = {"f64_in": 0.1, "word": "a b", "mood_in": -4.0}
    values |= {f"whole[{row},{column}]": 7.0 - row for row in (1, 2) for column in (1, 2, 3)}
    members = (
        Member("old", old, {"gain": 0.3}),
        Member("new", described("types"), values),
        Member("wide", wide),
        Member("other", wide),
        Member("third", wide),
    )
    links = connect(
        "old.count -> new.i32_in",
        "wide.y[1] -> other.u[1]",
        "wide.y[2] -> other.u[2]",
        "other.y[2] -> third.u[1]",
    )
    inputs = {"to f32": (Port("new", "f32_in"),), "row": (Port("wide", "u[2]"),)}
    return System("mixed", members, links, inputs, {"of f32": Port("new", "f32_out")})
