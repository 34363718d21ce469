"""TOML files for which Python's reader raises other exceptions than its own give a one-sentence error."""

from __future__ import annotations

import pytest

from baker.core.errors import SettingsError
from baker.io.toml_file import read_toml

HOSTILE = {
    "deep arrays": (b"a = " + b"[" * 5000 + b"]" * 5000, "too deeply nested|not valid TOML"),
    "deep tables": (b"a = " + b"{b = " * 5000 + b"1" + b"}" * 5000, "too deeply nested|not valid TOML"),
    "a long integer": (b"a = " + b"9" * 5000, "out of range|not valid TOML"),
    "a wrong date": (b"a = 2024-02-31", "out of range|not valid TOML"),
    "NUL": (b'a = "\0"', "not valid TOML"),
    "Latin-1": (b'a = "\xe9"', "not UTF-8"),
    "half of a surrogate pair": (b'a = "\\ud800"', "not valid TOML"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_give_one_sentence(case, tmp_path):
    data, words = HOSTILE[case]
    path = tmp_path / "a.toml"
    path.write_bytes(data)
    with pytest.raises(SettingsError, match=words) as caught:
        read_toml(path, "the configuration")
    assert caught.value.file == str(path)
    assert len(str(caught.value)) < 400


def test_a_byte_order_mark_is_ignored(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbfa = [1, 2]")
    assert read_toml(path, "the configuration") == {"a": [1, 2]}
