"""Wrapping of FMUs as FMUs for co-simulation of FMI 2.0, so that all else needs one interface only.

FMI 3.0 gets a translated description and a wrapped library, model exchange alone a solver.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
