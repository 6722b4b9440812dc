"""Records of a rig that is driven with the inputs of an experiment, without any model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
