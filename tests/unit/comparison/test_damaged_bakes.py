"""`diff` refuses damaged manifests before numbers from them reach a kernel.

The page number of an instance was once used unchecked. `texel_owners` computes an index from this number and
writes there. A page number slightly too large made it write beyond its array, and the process crashed later,
while it compared another folder.
"""

from __future__ import annotations

import json
import shutil
from functools import reduce
from operator import getitem

import pytest
from io_scenes import quad_result

import baker
from baker.core.errors import InputError
from baker.io.bake.write_bake import write_bake
from baker.metrics import texel_area

DAMAGES = [
    *((("instances", 0, "page"), page) for page in (1, 2, 1000, 2**31, 2**32, -1, 1e300, 1.5)),
    (("pages", 0), 1e300),
    *((("pages", 0, "page"), page) for page in (1, -1, 1e300)),
    *((("pages", 0, key), size) for key in ("width", "height") for size in (1, 31, 33, 2**31, 1e300)),
    (("instances", 0, "uv_scale"), [1e300, 1.0]),
    (("instances", 0, "uv_offset"), [0.0, -1e39]),
]


def test_a_process_that_reads_damaged_bakes_compares_sound_ones_as_before(tmp_path, monkeypatch):
    write_bake(quad_result(tmp_path), tmp_path / "sound")
    damaged = tmp_path / "damaged"
    shutil.copytree(tmp_path / "sound", damaged)
    text = (damaged / "bake.json").read_text()
    before = str(baker.diff(damaged, tmp_path / "sound", flip=False))
    kernel, reached = texel_area.texel_owners, []
    monkeypatch.setattr(texel_area, "texel_owners", lambda *a: (reached.append(a), kernel(*a)))
    for path, value in DAMAGES:
        manifest = json.loads(text)
        holder = reduce(getitem, path[:-1], manifest)
        holder[path[-1]] = value
        (damaged / "bake.json").write_text(json.dumps(manifest))
        with pytest.raises(InputError, match=r"bake the scene again|the manifest says"):
            baker.diff(damaged, tmp_path / "sound", flip=False)
        assert not reached, f"{path} = {value} reached a kernel"
    (damaged / "bake.json").write_text(text)
    assert str(baker.diff(damaged, tmp_path / "sound", flip=False)) == before
    assert reached
