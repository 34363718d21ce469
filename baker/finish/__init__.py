"""Finished pages from the values of texels: invalid texels filled, noise removed, charts extended."""
