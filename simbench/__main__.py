"""`python -m simbench`: the same as `simbench`."""

from simbench.cli import main

main(prog_name="simbench")
