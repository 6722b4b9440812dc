"""A system stepped by the stepping kernel: its schedule as a program, and a run of that."""
