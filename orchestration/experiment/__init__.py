"""Experiments as TOML files: read and checked, run on a component or a system, repeated from their own results.

:func:`.reading.read` reads one, :func:`.run.run` makes it; :func:`.library.shipped` tells which ones ship.
"""
