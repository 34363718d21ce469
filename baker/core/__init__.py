"""Data and checks that everything shares; knows nothing above it."""
