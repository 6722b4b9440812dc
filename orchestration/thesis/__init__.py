"""The thesis recomputed: what it prints beside what follows from it, chapter by chapter."""
