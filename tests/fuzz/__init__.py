"""Hostile input and broken folders: the program answers in one line, never with a traceback (seeded by FUZZ_SEED)."""
