"""The rig proxy: takes the place of a component and forwards its signals to the real rig."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..kit.registry import ComponentPackage
from . import local_key, protocol, rigs
from .credentials import ClientKeys, checked, key, read_client_keys, read_table
from .protocol import (
    ENDPOINT,
    IDLE,
    LATCHED,
    LOCKSTEP,
    MAX_FRAME,
    NOT_REACHED,
    OPERATOR,
    PORT,
    REAL_TIME,
    REQUESTS,
    RUNNING,
    SAFE,
    STOPPING,
    TELEMETRY,
    ProtocolError,
    decode,
    encode,
)
from .proxy import LINK_STATES, LOST, REFUSED
from .systems import HIL_BENCH

if TYPE_CHECKING:
    from .link import Link, LinkError, describe_latch

__all__ = [
    "ENDPOINT",
    "IDLE",
    "LATCHED",
    "LINK_STATES",
    "LOCKSTEP",
    "LOST",
    "MAX_FRAME",
    "NOT_REACHED",
    "OPERATOR",
    "PORT",
    "REAL_TIME",
    "REFUSED",
    "REQUESTS",
    "RUNNING",
    "SAFE",
    "STOPPING",
    "TELEMETRY",
    "ClientKeys",
    "Link",
    "LinkError",
    "ProtocolError",
    "checked",
    "decode",
    "describe_latch",
    "encode",
    "key",
    "local_key",
    "protocol",
    "read_client_keys",
    "read_table",
]
PACKAGE = ComponentPackage(
    proxies={
        "rig_proxy": "fmus.rig_proxy.model:RigProxy",
        "rig_proxy_length_driven": "fmus.rig_proxy.model:RigProxyLengthDriven",
        "rig_proxy_bench": "fmus.rig_proxy.model:RigProxyBench",
        "rig_proxy_thesis": "fmus.rig_proxy.model:RigProxyThesis",
        "rig_proxy_thesis_generator": "fmus.rig_proxy.model:RigProxyThesisGenerator",
    },
    declared_systems=(HIL_BENCH,),
    rigs=rigs.RIGS,
    experiment_folder=Path(__file__).with_name("experiments"),
    preset_folder=Path(__file__).with_name("presets"),
)


def __getattr__(name: str) -> Any:
    """Import the link when one of its names is first used: ZeroMQ is slow to import."""
    if name not in ("Link", "LinkError", "describe_latch"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import link

    return getattr(link, name)
