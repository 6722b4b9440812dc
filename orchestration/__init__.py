"""Simulation of FMUs and systems, and diagnosis of models against measured records.

``import ppy_rig as ppy`` offers its names. Importing this package is cheap: a name is loaded when
it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
