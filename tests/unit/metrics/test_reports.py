from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from baker.core.errors import ResourceError
from baker.io.junit import Case, junit_text, write_text
from baker.metrics.flip import flip_error


def test_junit_counts_and_escapes():
    cases = [Case("a", "g"), Case("b<", "g", 'too "big" & bad', 1.5), Case("c", "g", "no file", error=True)]
    suite = ElementTree.fromstring(junit_text("baker verify", cases).split("\n", 1)[1])[0]
    assert suite.attrib["tests"] == "3"
    assert suite.attrib["failures"] == "1"
    assert suite.attrib["errors"] == "1"
    assert [len(case) for case in suite] == [0, 1, 1]
    assert suite[1].attrib["name"] == "b<"
    assert suite[1][0].tag == "failure"
    assert suite[1][0].attrib["message"] == 'too "big" & bad'
    assert suite[2][0].tag == "error"


def test_a_report_is_whole_or_not_there(tmp_path: Path):
    write_text(tmp_path / "new" / "r.xml", "text")
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["r.xml"]
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="report"):
        write_text(tmp_path / "file" / "r.xml", "text")


def test_flip_of_equal_pictures_is_nothing_and_grows():
    image = np.random.default_rng(0).random((24, 24, 3)).astype(np.float32)
    means = [flip_error(image, image * factor)[1] for factor in (1.0, 1.1, 2.0)]
    assert means[0] == 0
    assert 0 < means[1] < means[2] < 1
    error, mean = flip_error(image[..., :1], image[..., :1])
    assert error.shape == (24, 24)
    assert mean == 0


def test_flip_of_black():
    black, grey = np.zeros((8, 8, 3), np.float32), np.full((8, 8, 3), 0.5, np.float32)
    assert flip_error(black, black)[1] == 0
    assert flip_error(black, grey)[1] == 1
