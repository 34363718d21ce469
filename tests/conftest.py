"""Stands here so that every test can import the helpers of this folder (pytest puts it on the path)."""
