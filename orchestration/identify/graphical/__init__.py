"""Parameters read off a curve: slope and area of loops, creep after a step load, a number with its interval."""
