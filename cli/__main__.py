"""Lets `python -m baker.cli` be the command too."""

from baker.cli.app import main

main()
