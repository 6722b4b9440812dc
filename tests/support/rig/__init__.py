<<<<<<< HEAD
"""A rig of the tests' own, and others that stand at its wire."""
=======
"""Shared by the tests of the rig's server: backends that fail on demand, a plain client, a bad link, a server."""
>>>>>>> f5cef04 (feat: the rig's server: front, device and guard, safety, and what an operator can ask)
