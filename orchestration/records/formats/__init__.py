"""The forms that files come in, a reader for each; all yield the same raw table."""
