"""python -m fluidbench."""

from .cli import main

main()
