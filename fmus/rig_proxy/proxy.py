"""Base of the rig proxies: address of the rig, bounds of waits, outputs about the link."""

from __future__ import annotations

from typing import Any

from ..kit import Component, Parameter, Text, UserError
from ..kit.declare import Declaration, Engine, OutputDeclaration, name_declaration
from .protocol import ENDPOINT

CONNECTED, REFUSED, STALE, LOST = range(4)
LINK_STATES = ("connected", "commands refused", "stale", "lost")
HOLD, FAIL = "hold", "fail"
AGE = "{}_age"  # name of the output with the age of a value

# C files with a header; the others of the engine have none
_NATIVE = (
    "clock",
    "sockets",
    "endpoint",
    "numbers",
    "json_reader",
    "json_writer",
    "messages",
    "zmtp",
    "local_key",
    "link",
    "proxy",
)

_ENGINE = Engine(
    slave="fmus.rig_proxy.slave:ProxySlave",
    needs={"zmq": "pyzmq"},
    folder="fmus.rig_proxy.native",
    sources=tuple(f"{name}.c" for name in (*_NATIVE, "handshake", "pace", "variables", "outputs")),
    headers=tuple(f"{name}.h" for name in (*_NATIVE, "platform")),
    libraries={"linux64": ("m",), "aarch64-linux": ("m",), "win64": ("ws2_32", "winmm")},
)


def _no_law(self: Any) -> float:
    """Return a placeholder for a value that depends on no other variable."""
    return 0.0


def Measured(unit: str, doc: str = "", **about: Any) -> Any:
    """Declare an output whose value is measured at the rig.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it, the same as at the rig.
    doc : str
        One sentence for the FMI ``description``.
    **about
        Range, nominal value, display unit: see :class:`fmus.kit.declare.Declaration`.
    """
    return OutputDeclaration(unit=unit, doc=doc, law=_no_law, **about)


class Proxy(Component):
    """Base of proxies: a subclass with a name, inputs and measured outputs is a proxy of its own.

    Every measured output ``y`` brings an output ``y_age``.
    """

    author = "the ppy-rig project"
    license = "BSD-3-Clause"
    experiment = (10.0, 1.0 / 30.0)
    engine = _ENGINE

    endpoint = Text(ENDPOINT, "where the rig's server listens")
    credentials = Text("", "file with the keys of this client (ppy rig keys); empty: no encryption")
    on_stale = Text(
        HOLD,
        "what to do when a value is older than max_age: hold (and say so in link_state) or fail",
    )
    communication_timeout = Parameter(
        1.0,
        "s",
        min=1e-3,
        max=60.0,
        doc="longest that any call waits for the rig; silence beyond it means a lost link",
    )
    max_age = Parameter(0.5, "s", min=1e-3, max=3600.0, doc="age beyond which a value is stale")
    deadline = Parameter(
        0.1,
        "s",
        min=1e-4,
        max=60.0,
        nominal=0.1,
        doc="time after which an answer that a step needs counts as missed",
    )

    def __init_subclass__(cls, **options: Any) -> None:
        measured = [v for v in vars(cls).values() if isinstance(v, OutputDeclaration)]
        for value in measured:
            setattr(cls, AGE.format(value.name), _age_of(value))
        if cls.name:
            for name, declaration in _link_outputs().items():
                setattr(cls, name, declaration)
        super().__init_subclass__(**options)
        if cls.name and not any(
            AGE.format(output.name) in cls.layout.names for output in cls.layout.outputs
        ):
            raise UserError(
                f"{cls.__module__}.{cls.__qualname__}: a proxy needs a measured output at least"
            )


def _age_of(value: Declaration) -> Any:
    """Return the output for the age of a measured value."""
    age = OutputDeclaration(unit="s", doc=f"age of {value.name}", law=_no_law, min=0.0, nominal=0.1)
    return name_declaration(age, AGE.format(value.name))


def _link_outputs() -> dict[str, Any]:
    """Return the outputs on the state of the link, which follow those of the rig."""
    outputs = {
        "round_trip_time": OutputDeclaration(
            unit="s",
            doc="from the sending of a command to its answer; without one, the time since",
            law=_no_law,
            min=0.0,
            nominal=1e-3,
        ),
        "missed_deadlines": OutputDeclaration(
            unit="1",
            doc="steps whose values did not come in time",
            law=_no_law,
            min=0.0,
            type="integer",
        ),
        "link_state": OutputDeclaration(
            unit="1",
            doc=", ".join(f"{n} {state}" for n, state in enumerate(LINK_STATES)),
            law=_no_law,
            min=0.0,
            max=float(LOST),
            type="integer",
        ),
    }
    return {name: name_declaration(output, name) for name, output in outputs.items()}
