"""The native build's engine of a rig proxy (``fmus/kit/fmi/engine.h``), in C: ZMTP on plain
sockets, loopback only.
"""
