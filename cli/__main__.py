"""Runs the command `baker` for `python -m baker.cli`."""

from baker.cli.start import main

main()
