"""Single FMUs of any origin: archives, instances, and models that are found by name.

Names are loaded when they are first used, so that listing variables loads nothing that runs FMUs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
