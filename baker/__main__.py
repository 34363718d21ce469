"""Runs the command `baker` for `python -m baker`."""

from baker.cli.start import main

main()
