"""Classes of options: each field has a name, type, default, range, description; the one file with pydantic.

Flags, keys of configuration files and the settings page are made from such classes.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

__all__ = ["BaseModel", "ConfigDict", "Field", "ValidationError", "field_validator"]
