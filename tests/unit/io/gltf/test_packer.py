"""`Packer` drops unused accessors and views; the remaining data are compared byte for byte with the input."""

from __future__ import annotations

import numpy as np
import pytest
from glb_reader import Glb

from baker.core.errors import InputError
from baker.io.gltf.accessor_bytes import element_size, gather_rows
from baker.io.gltf.packer import Packer


def random_document(seed: int) -> tuple[dict, tuple[bytes, ...], frozenset[int]]:
    """Return (document, buffers, indices of the accessors to be replaced).

    Each of the two buffers has six views at random offsets, which may overlap. Each view has one accessor.
    """
    rng = np.random.default_rng(seed)
    buffers = tuple(rng.integers(0, 256, size).astype(np.uint8).tobytes() for size in (203, 96))
    views, accessors = [], []
    for number, data in enumerate(buffers):
        for _ in range(6):
            start = int(rng.integers(0, len(data) - 8))
            views.append(
                {"buffer": number, "byteOffset": start, "byteLength": int(rng.integers(4, len(data) - start))}
            )
            view = {"bufferView": len(views) - 1, "componentType": 5121, "type": "SCALAR"}
            accessors.append({**view, "count": views[-1]["byteLength"]})
    document = {"asset": {"version": "2.0"}, "bufferViews": views, "accessors": accessors}
    return document, buffers, frozenset(rng.choice(12, int(rng.integers(0, 12)), replace=False).tolist())


@pytest.mark.parametrize("seed", range(20))
def test_what_is_still_used_keeps_its_index_and_bytes(seed: int) -> None:
    document, buffers, replaced = random_document(seed)
    wanted = [
        buffers[v["buffer"]][v["byteOffset"] : v["byteOffset"] + v["byteLength"]]
        for v in document["bufferViews"]
    ]
    packer = Packer(document, buffers, replaced)
    added = packer.add_floats(np.float32([[1, 2, 3]]))
    after = Glb(packer.glb())
    assert added == min(replaced, default=12), "free places are taken first"
    for index in set(range(12)) - replaced:
        assert after.view(after.json["accessors"][index]["bufferView"]) == wanted[index]
    assert after.accessor(added).tolist() == [[1, 2, 3]]
    for index in range(len(after.json["accessors"])):
        after.accessor(index)
    assert len(after.binary) <= sum(-(-len(b) // 4) * 4 for b in buffers) + 12


def test_bytes_of_no_view_stay_and_bytes_of_free_views_go() -> None:
    data = bytes(range(32))
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": 8},
        {"buffer": 0, "byteOffset": 16, "byteLength": 8},
    ]
    like = {"componentType": 5126, "count": 2, "type": "SCALAR"}
    accessors = [{"bufferView": 0, **like}, {"bufferView": 1, **like}]
    document = {"asset": {"version": "2.0"}, "bufferViews": views, "accessors": accessors}
    after = Glb(Packer(document, (data,), frozenset({0})).glb())
    assert after.binary == data[8:]
    assert after.view(1) == data[16:24]
    assert len(after.json["accessors"]) == 2, "accessor 1 keeps its index"


def test_what_animations_skins_and_extensions_name_is_not_dropped() -> None:
    like = {"componentType": 5126, "count": 1, "type": "SCALAR"}
    document = {
        "asset": {"version": "2.0"},
        "bufferViews": [{"buffer": 0, "byteOffset": 4 * k, "byteLength": 4} for k in range(6)],
        "accessors": [{"bufferView": k, **like} for k in range(6)],
        "skins": [{"joints": [0], "inverseBindMatrices": 0}],
        "animations": [{"channels": [], "samplers": [{"input": 1, "output": 2}]}],
        "nodes": [
            {"extensions": {"ACME": {"deep": [{"er": 3}]}}},
            {"extensions": {"KHR_lights_punctual": {"light": 5}}},
        ],
    }
    data = np.arange(6, dtype="<f4").tobytes()
    after = Glb(Packer(document, (data,), frozenset(range(6))).glb())
    assert [float(after.accessor(k)[0, 0]) for k in range(4)] == [0, 1, 2, 3]
    assert len(after.json["accessors"]) == 4, "those at the end are gone"
    assert len(after.binary) == 16


@pytest.mark.parametrize(("top", "code"), [(65534, 5123), (65535, 5125)])
def test_indices_take_the_smallest_type_that_is_safe(top: int, code: int) -> None:
    packer = Packer({"asset": {"version": "2.0"}})
    index = packer.add_indices(np.array([[0, 1, top]]))
    after = Glb(packer.glb())
    assert after.json["accessors"][index]["componentType"] == code
    assert after.accessor(index).ravel().tolist() == [0, 1, top]


@pytest.mark.parametrize(
    ("kind", "code", "size"),
    [
        ("SCALAR", 5121, 1),
        ("VEC3", 5123, 6),
        ("MAT2", 5121, 8),
        ("MAT3", 5121, 12),
        ("MAT3", 5123, 24),
        ("MAT4", 5126, 64),
    ],
)
def test_element_sizes_are_those_of_the_specification(kind: str, code: int, size: int) -> None:
    assert element_size({"type": kind, "componentType": code}) == size


def test_rows_that_are_not_there_are_refused() -> None:
    accessor = {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"}
    document = {"bufferViews": [{"buffer": 0, "byteLength": 24}], "accessors": [accessor]}
    rows = np.int32([1, 0, 1])
    data = np.arange(6, dtype="<f4")
    found = gather_rows(document, (data.tobytes(),), 0, rows)
    assert found.view("<f4").tolist() == [[3, 4, 5], [0, 1, 2], [3, 4, 5]]
    with pytest.raises(InputError, match="2 elements where 3 are needed"):
        gather_rows(document, (data.tobytes(),), 0, np.int32([2]))
    with pytest.raises(InputError, match="beyond its buffer"):
        gather_rows(document, (b"",), 0, rows)
    with pytest.raises(InputError, match="accessor 7: its data cannot be read"):
        gather_rows(document, (data.tobytes(),), 7, rows)
    accessor["type"] = "VEC9"
    with pytest.raises(InputError, match="cannot be read"):
        gather_rows(document, (data.tobytes(),), 0, rows)
