"""Validation of what was fitted and named: by unseen data, and by noise on the inputs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
