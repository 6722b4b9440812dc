"""The descriptions in an FMU: ``modelDescription.xml`` of FMI 2.0 or 3.0, and what 3.0 adds."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
