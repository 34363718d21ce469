"""The rules of `baker check`: one module for each subject, one function for each code."""
