"""Conformance of a rig's server with the protocol, rule by rule, whoever wrote the server."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
