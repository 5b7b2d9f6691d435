"""One run in one process: what it is asked, what it leaves, where it is kept, and who makes it."""
