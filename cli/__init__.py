"""The command line: parses arguments, calls the library, shows progress and prints results."""
