"""Laws of components as CasADi graphs, with their structure, sensitivities and C source."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
