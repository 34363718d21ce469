"""`baker check` on the command line: exit codes, JSON, SARIF, JUnit, and where `ignore` can be set."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from gltf_builder import QUAD, GltfBuilder, quad_builder, write
from io_scenes import write_timed_bake

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tests" / "unit" / "checks"))

from flawed_scenes import CASES  # noqa: E402

from baker.cli.app import run  # noqa: E402


def check(*arguments):
    """Run `baker check` in this process; return the exit code and the JSON object."""
    out = io.StringIO()
    code = run(["check", *map(str, arguments), "--json", "-q"], out=out)
    return code, json.loads(out.getvalue())


@pytest.fixture
def overlap(tmp_path):
    return write(tmp_path / "overlap.glb", CASES["uv.overlap"].bad)


def codes(result):
    return {finding["code"] for finding in result["findings"]}


def test_a_clean_scene_passes(tmp_path):
    code, result = check(write(tmp_path / "good.glb", CASES["uv.overlap"].good))
    assert code == 0
    assert result["passed"] is True


def test_an_error_fails_and_has_all_keys(overlap):
    code, result = check(overlap)
    assert code == 1
    assert result["passed"] is False
    found = next(f for f in result["findings"] if f["code"] == "uv.overlap")
    assert {"code", "severity", "object", "node", "count", "message", "fix"} <= set(found)
    assert (found["severity"], found["object"], found["node"]) == ("error", "part 0", 0)
    # Two squares of side 0.5 overlap in a rectangle of 0.1 x 0.5.
    assert found["percent"] == pytest.approx(10.0, abs=0.3)
    assert all(a != b for a, b in found["pairs"])


@pytest.mark.parametrize("code", ["index-range", "bad-vertices", "uv.overlap", "inside-out"])
def test_what_spoils_a_bake_is_a_finding_not_a_refusal(tmp_path, code):
    done, result = check(write(tmp_path / "scene.glb", CASES[code].bad))
    assert done == 1
    assert code in codes(result)


def test_index_out_of_range_in_other_formats(tmp_path):
    obj = write(tmp_path / "a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n")
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {k}\n" for k in "xyz")
    faces = "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    rows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 7\n"
    ply = write(tmp_path / "a.ply", (head + faces + rows).encode())
    for path in (obj, ply):
        code, result = check(path)
        assert code == 1
        assert "index-range" in codes(result)


def test_warnings_fail_only_if_asked(tmp_path):
    path = write(tmp_path / "scene.glb", CASES["zero-area"].bad)
    assert check(path)[0] == 0
    assert check(path, "--fail-on", "warning")[0] == 1
    code, result = check(path, "--fail-on", "warning", "--ignore", "zero-area", "--ignore", "no-light")
    assert code == 0
    assert "zero-area" not in codes(result)
    assert result["scenes"][0]["ignored"] == 2


def test_ignore_for_one_object(overlap):
    assert check(overlap, "--ignore", "uv.overlap@other")[0] == 1
    assert check(overlap, "--ignore", "uv.overlap@part*")[0] == 0


def test_config_table(overlap, tmp_path):
    config = tmp_path / "bake.toml"
    config.write_text('[bake]\nresolution = 64\n[check]\nignore = ["uv.overlap"]\n')
    assert check(overlap, "--config", config)[0] == 0
    config.write_text('[check]\nignroe = ["uv.overlap"]\n')
    code, result = check(overlap, "--config", config)
    assert code == 2
    assert "ignore" in result["error"]["message"]


@pytest.mark.parametrize("where", ["document", "node", "node all"])
def test_extras_of_the_scene(tmp_path, where):
    builder = GltfBuilder()
    uv = np.zeros((4, 2), np.float32)
    triangle = np.uint16([[0, 1, 2], [0, 2, 3]])
    builder.node(mesh=builder.mesh(builder.primitive(QUAD, triangle, TEXCOORD_1=uv)), name="it")
    assert check(write(tmp_path / "plain.glb", builder))[0] == 1
    rule = {"baker": {"check": {"ignore": True if where == "node all" else ["uv.degenerate"]}}}
    if where == "document":
        builder.json["extras"] = rule
    else:
        builder.json["nodes"][0]["extras"] = rule
    assert check(write(tmp_path / "extras.glb", builder))[0] == 0


def test_extras_of_a_node_do_not_hide_findings_about_other_nodes_of_its_name(tmp_path):
    builder = GltfBuilder()
    triangle = np.uint16([[0, 1, 2], [0, 2, 3]])
    uv = np.zeros((4, 2), np.float32)
    for shift in (0, 2):
        flawed = builder.primitive(QUAD + np.float32([shift, 0, 0]), triangle, TEXCOORD_1=uv)
        builder.node(mesh=builder.mesh(flawed), name="twin [1]")
    path = write(tmp_path / "twins.glb", builder)

    def nodes():
        return [f["node"] for f in check(path)[1]["findings"] if f["code"] == "uv.degenerate"]

    assert nodes() == [0, 1]
    builder.json["nodes"][1]["extras"] = {"baker": {"check": {"ignore": True}}}
    write(path, builder)
    assert nodes() == [0]


def test_extras_can_set_the_limit_and_the_command_line_wins(tmp_path):
    builder = quad_builder()
    builder.json["extras"] = {"baker": {"check": {"fail_on": "warning"}}}
    path = write(tmp_path / "scene.glb", builder)
    assert check(path)[0] == 1  # no-light
    assert check(path, "--fail-on", "error")[0] == 0


def test_unreadable_files(tmp_path, overlap):
    broken = write(tmp_path / "broken.glb", b"glTF no more")
    code, result = check(broken)
    assert code == 3
    assert result["error"]["file"] == str(broken)
    code, result = check(broken, overlap)
    assert code == 3
    assert "uv.overlap" in codes(result)
    assert [entry["passed"] for entry in result["scenes"]] == [False, False]


def test_wrong_use(overlap):
    assert check(overlap, "--fail-on", "info")[0] == 2
    code, result = check(overlap, "--ignore", "zero-aera")
    assert code == 2
    assert "zero-area" in result["error"]["message"]
    assert check(overlap, "--rates", overlap.parent)[0] == 2


def test_folders_and_patterns(tmp_path, overlap):
    write(tmp_path / "zero.glb", CASES["zero-area"].bad)
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "grey.png").write_bytes(b"PNG")
    for argument in (tmp_path, tmp_path / "*.glb", tmp_path / "*", tmp_path.parent / f"{tmp_path.name}*"):
        code, result = check(argument)
        assert code == 1
        assert len(result["scenes"]) == 2
    assert check(tmp_path / "tex*")[0] == 3


def test_sarif_is_valid_and_points_at_rules(tmp_path, overlap, monkeypatch):
    from pydantic_sarif import model

    monkeypatch.chdir(tmp_path)
    check(overlap, "--sarif", tmp_path / "out.sarif", "--ignore", "no-light")
    log = json.loads((tmp_path / "out.sarif").read_text("utf-8"))
    model.StaticAnalysisResultsFormatSarifVersion210JsonSchema.model_validate(log)
    (only,) = log["runs"]
    rules = only["tool"]["driver"]["rules"]
    assert only["results"]
    for result in only["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        assert uri == "overlap.glb"
        assert bool(result.get("suppressions")) == (result["ruleId"] == "no-light")


def test_junit_fails_what_reaches_the_limit(tmp_path, overlap):
    check(overlap, "--junit", tmp_path / "out.xml")
    suite = ElementTree.parse(tmp_path / "out.xml").getroot()
    failed = {case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None}
    assert failed == {"uv.overlap"}


def test_a_bake_tells_of_parts_inside_out(tmp_path):
    import baker

    for name, expected in (("bad", ["inside-out"]), ("good", [])):
        path = write(tmp_path / f"{name}.glb", getattr(CASES["inside-out"], name))
        result = baker.bake(path, resolution=32, channels=["ao"], samples=1, denoise=False)
        assert [w.code for w in result.warnings if w.code == "inside-out"] == expected


def test_cost_by_the_speed_of_a_bake(tmp_path):
    timings = {"final gather": 2.0, "ambient occlusion": 2.0, "finish": 1.0}
    write_timed_bake(tmp_path / "out", 10_000, timings=timings, rays={"final gather": 1_000_000})
    path = write(tmp_path / "scene.glb", quad_builder())
    arguments = ["--resolution", 64, "--channels", "ao", "--ao-samples", 10, "--rates", tmp_path / "out"]
    _, result = check(path, *arguments)
    cost = next(f for f in result["findings"] if f["code"] == "cost")
    texels = round(0.8 * 64 * 64)
    assert cost["texels"] == texels
    assert cost["rays"] == {"inside geometry": 4 * texels, "ambient occlusion": 10 * texels}
    # The rates of `bake.json`: 2 s for a million rays, 1 s for ten thousand texels.
    assert cost["seconds"] == pytest.approx(14 * texels * 2e-6 + texels * 1e-4, abs=0.01)


def bake_beside(scene, name, seconds, *, of=None, created="2026-01-01T00:00:00Z", **more):
    members = {
        "input": {"path": f"../{of or scene.name}", "sha256": None},
        "created": created,
        "timings": {"ambient occlusion": seconds},
        "rays": {"ambient occlusion": 1_000_000},
    }
    write_timed_bake(scene.parent / name, 10_000, **members | more)


def test_cost_by_the_speed_of_the_latest_bake_beside_the_scene(tmp_path):
    path = write(tmp_path / "scene.glb", quad_builder())
    arguments = ["--resolution", 64, "--channels", "ao", "--ao-samples", 10]

    def cost(*more):
        _, result = check(path, *arguments, *more)
        return next(f for f in result["findings"] if f["code"] == "cost")

    # These folders must be ignored: bakes of other scenes, broken manifests, and folders without a bake.
    bake_beside(path, "other", 9.0, of="other.glb")
    bake_beside(path, "hollow", 9.0, timings=None)
    bake_beside(path, "odd", 9.0, input=[])
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "bake.json").write_text("{")
    assert "seconds" not in cost()
    bake_beside(path, "first", 9.0, created="2025-01-01T00:00:00Z")
    bake_beside(path, "later", 2000.0)
    bake_beside(path, "before", 9.0, created="2025-01-01T00:00:00Z")
    found = cost()
    assert found["basis"] == "the bake in 'later'"
    assert found["seconds"] == pytest.approx(14 * round(0.8 * 64 * 64) * 2e-3, rel=0.01)
    # If an earlier bake is found, `--cost` uses its rates and measures none. `--rates` takes precedence over
    # an earlier bake.
    assert cost("--cost")["basis"] == "the bake in 'later'"
    assert cost("--rates", tmp_path / "first")["seconds"] < found["seconds"] / 100


def test_a_light_in_watts_times_683_is_explained(tmp_path):
    builder = quad_builder()
    sun = {"type": "directional", "intensity": 683000.0}
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [sun]}}
    builder.node(name="Sun", extensions={"KHR_lights_punctual": {"light": 0}})
    _, result = check(write(tmp_path / "sun.glb", builder))
    (found,) = (f for f in result["findings"] if f["code"] == "light-intensity")
    assert "683 lm/W" in found["message"]
    assert "Unitless: 1000 lx" in found["message"]


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_names_that_the_terminal_cannot_show_are_no_failure(tmp_path, encoding):
    builder = quad_builder()
    builder.json["nodes"][0]["name"] = "стена 💡"
    path = write(tmp_path / "Räume-комната.glb", builder)
    env = {**os.environ, "PYTHONIOENCODING": encoding, "LC_ALL": "C"}
    env.pop("PYTHONUTF8", None)
    done = subprocess.run(
        [sys.executable, "-m", "baker.cli", "check", "-v", path], env=env, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"\\u0441\\u0442\\u0435\\u043d\\u0430 \\U0001f4a1" in done.stdout
