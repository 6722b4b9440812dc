"""Systems of FMUs as SSP 1.0: described, read, written, checked and drawn."""

from orchestration.system.model import Connection, Member, Port, System, connect

__all__ = ["Connection", "Member", "Port", "System", "connect"]
