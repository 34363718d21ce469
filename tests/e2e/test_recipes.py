"""The recipes of docs/BATCH.md work: the whole Makefile, and the shell lines of the CI pipelines."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "docs" / "recipes"
# Flags of a short `verify`.
QUICK = "--texels 20 --spp 4"
LIMITS = "irradiance.median > 0.5"


@pytest.fixture(scope="module")
def game(tmp_path_factory):
    """Return a folder with the layout of the recipes, baked by the Makefile."""
    folder = tmp_path_factory.mktemp("recipes") / "game"
    (folder / "levels").mkdir(parents=True)
    shutil.copy(ROOT / "assets" / "cornell.glb", folder / "levels")
    shutil.copy(RECIPES / "Makefile", folder)
    write_jobs(folder, 48)
    code, text = run(folder, "make", "bake")
    assert code == 0, text
    assert "1 baked, 0 unchanged" in text
    return folder


def write_jobs(folder, resolution):
    text = (RECIPES / "JOBS.toml").read_text("utf-8")
    for old, new in (("resolution = 1024", f"resolution = {resolution}"), ('"high"', '"preview"')):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "JOBS.toml").write_text(text)


def run(folder, *command, **more):
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, **more, "PATH": path}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=240, check=False
    )
    return done.returncode, done.stdout + done.stderr


def make(folder, limits=LIMITS):
    return run(folder, "make", f"VERIFY={QUICK}", f"LIMITS={limits}")


def told(folder, name):
    """Return the number of test cases and the number of failures in a JUnit file."""
    root = ElementTree.parse(folder / "reports" / name).getroot()
    return int(root.get("tests")), int(root.get("failures"))


def test_the_makefile(game):
    code, text = make(game)
    assert code == 0, text
    assert [told(game, f"{name}.xml") for name in ("batch", "verify-cornell")] == [(1, 0), (1, 0)]

    # A second run does nothing, although the scene's file time changed.
    (game / "levels" / "cornell.glb").touch()
    code, text = make(game)
    assert code == 0, text
    assert "0 baked, 1 unchanged" in text
    assert "baker verify" not in text

    # A changed setting causes a new bake and its verification. Here the verification fails, because its
    # limits are such that no bake passes.
    write_jobs(game, 32)
    code, text = make(game, "irradiance.median > 0.000001")
    assert code != 0
    assert "1 baked, 0 unchanged" in text
    assert told(game, "verify-cornell.xml") == (1, 1)
    # The new bake is kept. The stamp file of the Makefile is older than the bake, so the next run
    # verifies the bake again.
    stamp, bake = game / "reports" / "cornell.verified", game / "baked" / "cornell" / "bake.json"
    assert stamp.stat().st_mtime < bake.stat().st_mtime


def test_the_makefile_stops_at_a_scene_that_is_no_scene(game, tmp_path):
    folder = tmp_path / "game"
    shutil.copytree(game, folder, ignore=shutil.ignore_patterns("baked", "reports"))
    (folder / "levels" / "pointer.glb").write_text("version https://git-lfs.github.com/spec/v1\n")
    code, text = make(folder)
    assert code != 0
    assert "pointer.glb" in text
    assert not (folder / "baked").exists()


def github():
    """Return the shell lines of each step of the GitHub recipe, and its variables."""
    job = yaml.safe_load((RECIPES / "github-actions.yml").read_text("utf-8"))["jobs"]["bake"]
    assert job["defaults"]["run"]["shell"] == "bash"
    return [step["run"] for step in job["steps"] if "run" in step], job["env"]


def gitlab():
    """Return the shell lines of the GitLab recipe and its variables."""
    job = yaml.safe_load((RECIPES / "gitlab-ci.yml").read_text("utf-8"))["bake"]
    return [*job["before_script"], "\n".join(job["script"])], job["variables"]


@pytest.mark.parametrize("recipe", [github, gitlab])
def test_the_lines_of_a_pipeline(game, tmp_path, recipe):
    folder = tmp_path / "game"
    # Copy the bakes, as if they came from the cache of the CI service.
    shutil.copytree(game, folder, ignore=shutil.ignore_patterns("reports"))
    steps, variables = recipe()
    assert steps[0].startswith("pip install ")
    assert set(variables) == {"VERIFY", "LIMITS"}
    text = ""
    for step in steps[1:]:
        code, said = shell(folder, step)
        assert code == 0, said
        text += said
    assert "0 baked, 1 unchanged" in text
    found = sorted(path.name for path in (folder / "reports").iterdir())
    assert found == ["batch.xml", "check.xml", "verify-cornell.xml"]
    # If a verification fails, here because of a limit with an unknown name, the job fails.
    code, said = shell(folder, steps[-1], limits="irradiance.nothing > 1")
    assert code != 0
    assert "nothing" in said


def shell(folder, lines, limits=LIMITS):
    """Run shell lines with the options of both services: stop at the first line that fails."""
    return run(folder, "bash", "-eo", "pipefail", "-c", lines, VERIFY=QUICK, LIMITS=limits)


def dockerfile():
    """Return the Dockerfile as a list of (instruction, arguments), with continued lines joined."""
    lines = (RECIPES / "Dockerfile").read_text("utf-8").splitlines()
    text = re.sub(r"\\\n\s*", "", "\n".join(line for line in lines if not line.startswith("#")))
    return [tuple(line.split(maxsplit=1)) for line in text.splitlines() if line]


def test_the_image_gets_all_that_the_install_needs():
    copied = [rest.split() for word, rest in dockerfile() if word == "COPY"]
    names = {name for *names, _ in copied for name in names}
    assert all((ROOT / name).exists() for name in names)
    assert names >= {"pyproject.toml", "README.md", "LICENSE", "baker", "cli"}
    words = [word for word, _ in dockerfile()]
    assert words[0] == "FROM"
    assert set(words) == {"FROM", "ENV", "COPY", "RUN", "WORKDIR", "ENTRYPOINT"}


def test_the_commands_of_the_image(tmp_path):
    install, times, warm = (rest for word, rest in dockerfile() if word == "RUN")
    assert re.fullmatch(r"pip install .* --no-compile /src", install)

    # Numba and Python store the modification times of source files with compiled code, to detect changes.
    # Therefore the image sets these times to a fixed value.
    (tmp_path / "baker").mkdir()
    (tmp_path / "baker" / "a.py").write_text("x = 1\n")
    code, said = run(tmp_path, "sh", "-ec", re.sub(r'^cd ".*?" &&', "", times))
    assert code == 0, said
    assert (tmp_path / "baker" / "a.py").stat().st_mtime == 1577836800.0
    assert len(list((tmp_path / "baker" / "__pycache__").iterdir())) == 1

    # NUMBA_CACHE_DIR is not set here, so the bake uses the kernels that other tests compiled.
    for old, new in (
        ("interior", "cornell"),
        ("/src", str(ROOT)),
        ("/var/warm", "warm"),
        ('"$NUMBA_CACHE_DIR"', "cache"),
    ):
        assert old in warm
        warm = warm.replace(old, new)
    code, said = run(tmp_path, "sh", "-ec", warm)
    assert (code, said) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {"baker", "cache"}
