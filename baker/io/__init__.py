"""Reads and writes scene files, images and JUnit reports; `baker.io.importers` holds the importer plugins."""
