"""Conformance of a rig's server with the protocol, rule by rule, whoever wrote the server."""
