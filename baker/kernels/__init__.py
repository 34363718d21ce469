"""Numba kernels: arrays and numbers only."""
