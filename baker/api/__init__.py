"""The functions of the Python API, available as attributes of `baker`."""
