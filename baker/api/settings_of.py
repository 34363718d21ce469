"""Combines the settings object and the keywords of a call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from baker.core.errors import SettingsError
from baker.core.settings_model import Settings

S = TypeVar("S", bound=Settings)


def settings_of(model: type[S], settings: S | None, keywords: Mapping[str, Any]) -> S:
    """Return `settings`, or the defaults if it is None, after replacing values by those in `keywords`.

    Raises
    ------
    SettingsError
        If `settings` is of another class, or a keyword is unknown or out of range.
    """
    if settings is None:
        return model.make(keywords)
    if not isinstance(settings, model):
        raise SettingsError(f"settings of the class {type(settings).__name__} are no {model.__name__}")
    return settings.changed(**keywords) if keywords else settings
