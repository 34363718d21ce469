"""Runs the command `baker` for `python -m baker.cli`."""

from baker.cli.app import main

main()
