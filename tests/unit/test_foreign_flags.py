"""For a flag of another baker, the error names a flag of equal purpose or a section of docs/LIMITS.md."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest

from baker.cli.app import run
from baker.cli.bake import bake
from baker.cli.config import resolve
from baker.core.errors import SettingsError
from baker.core.foreign_names import LIMITED, SAME
from baker.core.settings import BakeSettings, make_settings
from baker.jobs.jobs_file import read_jobs

DOCS = Path(__file__).parents[2] / "docs"
KNOWN = {name for option in bake().params for name in (*option.opts, *option.secondary_opts)}


def said(*words):
    out = io.StringIO()
    assert run([*words, "--json"], out=out) == 2
    return json.loads(out.getvalue())["error"]["message"]


@pytest.mark.parametrize(
    ("flag", "words"),
    [
        ("--gpu", "see 'CPU only' in docs/LIMITS.md"),
        ("--hdri=sky.hdr", "see 'A sky of one colour' in docs/LIMITS.md"),
        ("--probes", "see 'No probes' in docs/LIMITS.md"),
        ("--directional", "see 'One value per texel' in docs/LIMITS.md"),
        ("--denoiser", "use --denoise;"),
        ("--texel_density", "use --density;"),
        ("--spp", "use --samples;"),
        ("--use-gpu", "see 'CPU only'"),
    ],
)
def test_a_flag_of_another_baker_is_answered_by_its_purpose(flag, words):
    message = said("bake", "a.glb", "-o", "x", flag)
    assert words in message
    assert flag.partition("=")[0] in message


def test_a_flag_that_the_command_lacks_is_not_recommended():
    assert "--samples" not in said("inspect", "a.glb", "--rays")
    assert "--resolution" in said("bake", "a.glb", "-o", "x", "--resolutio")


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("gpu", "there is no setting 'gpu'; see 'CPU only' in docs/LIMITS.md"),
        ("use_gpu", "see 'CPU only'"),
        ("spp", "there is no setting 'spp'; use 'samples'"),
        ("margin", "use 'padding'"),
        ("sky-color", "use 'sky'"),
        ("overwrite", "there is no setting 'overwrite'; known are"),  # --force is no setting
        ("samplse", "did you mean 'samples'?"),
    ],
)
def test_a_key_of_another_baker_is_answered_in_files_and_in_python(key, words, tmp_path):
    config, jobs = tmp_path / "baker.toml", tmp_path / "jobs.toml"
    config.write_text(f"{key} = 1\n")
    jobs.write_text(f'[[job]]\nscene = "a.glb"\nout = "x"\n{key} = 1\n')
    for make in (
        lambda: make_settings({key: 1}),
        lambda: resolve([BakeSettings], {}, config),
        lambda: read_jobs(jobs, {}),
    ):
        with pytest.raises(SettingsError) as caught:
            make()
        assert words in caught.value.message


def test_the_lists_name_flags_and_sections_that_exist():
    assert {f"--{setting}" for setting in SAME} <= KNOWN
    titles = re.findall(r"^## (.+)$", (DOCS / "LIMITS.md").read_text("utf-8"), re.MULTILINE)
    assert [title for title in titles if title != "Numbers"] == list(LIMITED)
    names = [name for lists in (SAME, LIMITED) for names in lists.values() for name in names]
    assert len(set(names)) == len(names)
    assert not {f"--{name}" for name in names} & KNOWN
    for flag in re.findall(r"`(--[a-z-]+)", (DOCS / "LIMITS.md").read_text("utf-8")):
        assert flag in KNOWN, flag
