"""The viewer's server sends the data of a bake to the page, and refuses all other requests."""

from __future__ import annotations

import http.client
import json
import threading
from pathlib import Path

import numpy as np
import pytest
from view_bake import PLAIN_AT, SIZE, make_bake, plain_uv

from baker.core.errors import InputError, ResourceError
from baker.io.bake.read_bake import read_bake
from baker.viewer import script
from baker.viewer.page_data import page_numbers
from baker.viewer.scene_data import scene_data
from baker.viewer.script import find_three
from baker.viewer.server import make_server


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return make_bake(tmp_path_factory.mktemp("view"), name="hall of mirrors ü")


@pytest.fixture(scope="module")
def server(out):
    # A file of the user in the output folder, and a file outside it that only a changed manifest lists.
    (out / "notes.txt").write_text("private")
    (out.parent / "secret.txt").write_text("private")
    sound = (out / "bake.json").read_text("utf-8")
    manifest = json.loads(sound)
    manifest["files"].append({"file": "../secret.txt", "sha256": "0" * 64})
    (out / "bake.json").write_text(json.dumps(manifest), "utf-8")
    with pytest.raises(InputError, match=r"no readable bake\.json"):
        read_bake(out)
    (out / "bake.json").write_text(sound, "utf-8")
    server = make_server(read_bake(out), find_three(None))
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


def ask(server, path, *, method="GET", host=None):
    line = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    line.putrequest(method, path, skip_host=True)
    line.putheader("Host", host or f"127.0.0.1:{server.server_port}")
    line.endheaders()
    answer = line.getresponse()
    content = answer.read()
    line.close()
    return answer, content


def test_the_page_and_all_it_names_are_there(server, out):
    answer, content = ask(server, "/")
    assert answer.status == 200
    assert answer.getheader("Content-Type").startswith("text/html")
    assert "default-src 'self'" in answer.getheader("Content-Security-Policy")
    header = json.loads(ask(server, "/scene.json")[1])
    named = ["static/style.css", "static/icon.svg", "static/main.js", header["three"]["file"], "geometry.bin"]
    named += ["status/0.bin", "status/1.bin", "page/irradiance/1.bin", "page/ao/0.bin"]
    named += ["image/0.bin", "out/irradiance_1.exr"]
    for name in named:
        assert ask(server, f"/{name}")[0].status == 200, name
    for name in ("style.css", "icon.svg", "main.js"):
        assert f"static/{name}".encode() in content
    assert ask(server, "/out/scene.glb")[1] == (out / "scene.glb").read_bytes()
    answer, content = ask(server, "/out/scene.glb", method="HEAD")
    assert (answer.status, content) == (200, b"")
    assert int(answer.getheader("Content-Length")) == (out / "scene.glb").stat().st_size


@pytest.mark.parametrize(
    "path",
    [
        "/out/notes.txt",
        "/out/../secret.txt",
        "/out/%2e%2e/secret.txt",
        "/out/..%2fsecret.txt",
        "/secret.txt",
        "/static/../server.py",
        "/static/..%2f..%2fpipeline.py",
        "/three/../../../../../../etc/passwd",
        "//etc/passwd",
        "/etc/passwd",
        "/page/irradiance/2.bin",
        "/page/irradiance/-1.bin",
        "/status/00.bin",
        "/static/",
        "/out/%00",
    ],
)
def test_nothing_else_of_the_disk_is_handed_out(server, path):
    answer, content = ask(server, path)
    assert answer.status == (400 if path.startswith("//") else 404)
    assert b"private" not in content


def test_only_this_machine_is_answered(server):
    assert server.server_address[0] == "127.0.0.1"
    for host in ("evil.example", f"evil.example:{server.server_port}", "127.0.0.1:1", "127.0.0.1"):
        assert ask(server, "/scene.json", host=host)[0].status == 403
    assert ask(server, "/scene.json", host=f"localhost:{server.server_port}")[0].status == 200


def test_methods_that_write_are_refused(server):
    assert ask(server, "/scene.json", method="POST")[0].status == 501


def test_a_deleted_file_gives_an_error_status(server, out):
    ao = out / "ao_1.exr"
    content = ao.read_bytes()
    ao.unlink()
    assert ask(server, "/out/ao_1.exr")[0].status == 410
    ao.write_bytes(content)


def test_a_taken_port_is_said(server, out):
    with pytest.raises(ResourceError, match="is taken"):
        make_server(read_bake(out), find_three(None), port=server.server_port)


def test_values_of_half_floats_are_sent_as_half_floats():
    rng = np.random.default_rng(0)
    half = rng.normal(0, 100, (4, 5, 3)).astype(np.float16).astype(np.float32)
    half[0, 0] = (np.inf, np.nan, 6.1e-5)
    half[0, 0, 2] = np.float32(np.float16(6.1e-5))
    numbers = page_numbers(half)
    assert (numbers.dtype, numbers.shape) == (np.float16, (4, 5, 4))
    np.testing.assert_array_equal(numbers[:, :, :3].astype(np.float32), half)
    assert np.all(numbers[:, :, 3] == 1)
    for odd in (1.0001, 70000.0):
        single = np.full((2, 2, 1), odd, np.float32)
        numbers = page_numbers(single)
        assert (numbers.dtype, numbers.shape) == (np.float32, (2, 2, 1))
        np.testing.assert_array_equal(numbers, single)


def test_the_arrays_place_every_triangle(out):
    data = scene_data(read_bake(out))
    header = data.header
    assert header["name"] == "hall of mirrors ü"

    def array(name):
        section = header["sections"][name]
        kind = {"float": np.float32, "uint": np.uint32}[section["type"]]
        size = section["rows"] * section["width"]
        return np.frombuffer(data.geometry, kind, size, section["offset"]).reshape(-1, section["width"])

    assert [(g["page"], g["material"], g["count"]) for g in header["groups"]] == [
        (0, 0, 2),
        (1, 1, 2),
        (1, 2, 2),
    ]
    plain = header["groups"][1]
    triangle = array("triangle")[plain["start"] : plain["start"] + plain["count"]]
    x, y, side, z = PLAIN_AT
    corner = array("position")[triangle]
    s, t = (corner[..., 0] - x) / side, (corner[..., 1] - y) / side
    np.testing.assert_allclose(corner[..., 2], z)
    np.testing.assert_allclose(array("pageUv")[triangle], np.stack(plain_uv(s, t), axis=-1), atol=1e-6)
    assert set(array("instance")[plain["start"] : plain["start"] + 2].ravel().tolist()) == {1}
    assert header["status"] == np.bincount(read_bake(out).status.ravel(), minlength=5).tolist()
    assert header["status"][0] < 2 * SIZE * SIZE
    assert (header["camera"]["position"], header["camera"]["forward"]) == ([0, 0, 5], [0, 0, -1])
    light = next(channel for channel in header["channels"] if channel["name"] == "irradiance")
    assert light["low"] < light["median"] < light["high"]


def test_the_installed_three_is_found():
    found = find_three(None)
    assert not found.module
    assert b"three.js" in found.path.read_bytes()[:200].lower()


def test_npm_s_three_is_found_by_folder_or_file(tmp_path):
    build = tmp_path / "node_modules" / "three" / "build"
    build.mkdir(parents=True)
    for name in ("three.module.js", "three.core.js"):
        (build / name).write_text("export {};")
    for place in (tmp_path, tmp_path / "node_modules" / "three", build, build / "three.module.js"):
        found = find_three(place)
        assert found.module
        assert set(found.files) == {"three.module.js", "three.core.js"}


def test_a_place_without_three_is_refused(tmp_path):
    (tmp_path / "readme.txt").write_text("")
    for place in (tmp_path, tmp_path / "nowhere", tmp_path / "readme.txt"):
        with pytest.raises(InputError, match=r"no three\.js here"):
            find_three(place)


def test_a_missing_library_is_a_sentence(monkeypatch):
    monkeypatch.setattr(script, "find_spec", lambda name: None)
    with pytest.raises(ResourceError, match="pip install jupyter-threejs-sage"):
        find_three(None)


def test_scripts_build_no_html_from_strings(out):
    # The page must show names as text only, so its scripts may not build HTML from strings.
    for path in (Path(script.__file__).parent / "static").glob("*.js"):
        text = path.read_text("utf-8")
        assert not any(word in text for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "eval(")), (
            path
        )


def test_a_channel_that_baker_does_not_know_is_refused(tmp_path):
    out = make_bake(tmp_path, name="hall")
    text = (out / "bake.json").read_text("utf-8")
    (out / "bake.json").write_text(text.replace('"channel": "ao"', '"channel": "aoo"'), "utf-8")
    with pytest.raises(InputError, match="no channel 'aoo'; did you mean 'ao'"):
        make_server(read_bake(out), find_three(None))
