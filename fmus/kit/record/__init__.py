"""A component over a whole record in one call: compiled, or interpreted where there is no C compiler."""
