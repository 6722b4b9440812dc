"""The native build's engine of a rig proxy (``fmus/kit/fmi2/engine.h``), in C: ZMTP on plain
sockets, loopback only.
"""
