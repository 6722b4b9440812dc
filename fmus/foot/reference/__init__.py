"""Reference results of both forms of the foot, from an independent solution."""
