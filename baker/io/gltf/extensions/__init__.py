"""Describes how each glTF extension is handled: one file for each extension, or for several with one rule."""
