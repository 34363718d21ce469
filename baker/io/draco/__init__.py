"""Decodes Draco meshes in a child process, because the decoder is C++ code and files may be hostile."""
