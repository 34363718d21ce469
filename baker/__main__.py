"""Runs the command `baker` for `python -m baker`."""

from baker.cli.app import main

main()
