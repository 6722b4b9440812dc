"""A rig of the tests' own, and others that stand at its wire."""
