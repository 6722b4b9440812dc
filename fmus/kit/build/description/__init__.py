"""The XML files of an FMU: ``modelDescription.xml`` of FMI 2.0 or 3.0, and the others of 3.0."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
