"""Experiments as TOML files: read, checked, run on a component or a system, and repeated.

:func:`.reading.read` reads an experiment, :func:`.execution.run` runs it, and
:func:`.library.shipped` lists those that ship.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
