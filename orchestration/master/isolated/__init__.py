"""A run in a process of its own, of which the rows outlive it."""
