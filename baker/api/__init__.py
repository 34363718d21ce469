"""The functions of the Python API, which `import baker` offers."""
