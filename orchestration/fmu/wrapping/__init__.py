"""Wrapping of FMUs of FMI 3.0 as FMUs of FMI 2.0: translated description and wrapped library.

All other modules then need one interface only.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
