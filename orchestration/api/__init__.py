"""The user's functions in Python; `orchestration` hands them on."""
