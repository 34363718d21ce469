"""Registering a check with invalid arguments raises a ValueError that names the check."""

from __future__ import annotations

import pytest

from baker.checks.rule import CHECKS, check


def documented(context):
    """Return no findings."""
    return ()


def undocumented(context):
    return ()


@pytest.mark.parametrize(
    ("code", "changes", "function", "sentence"),
    [
        ("new-code", {"group": "shape"}, documented, "check 'new-code': group 'shape' is none of geometry, "),
        (
            "new-code",
            {"severity": "fatal"},
            documented,
            "check 'new-code': severity 'fatal' is none of info, ",
        ),
        ("new-code", {}, undocumented, "check 'new-code' has no docstring"),
        ("cost", {}, documented, "'cost' is registered twice"),
    ],
)
def test_a_wrong_registration_is_an_error(code, changes, function, sentence):
    known = CHECKS.names()
    settings = {"group": "geometry", "severity": "info", "fix": "nothing to do", **changes}
    with pytest.raises(ValueError, match=sentence):
        check(code, **settings)(function)
    assert CHECKS.names() == known
