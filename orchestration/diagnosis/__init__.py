"""Diagnosis by terms: what a law of a model lacks, searched in free runs over records."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
