"""An encoding's option, added by one new file, gets a flag, a configuration key and a settings page entry."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import test_encodings

from baker.core.encoding import ENCODINGS, encoding_options
from baker.core.settings import BakeSettings, CommonSettings

ROOT = Path(__file__).parents[2]
TOY = '''
"""Maps as NumPy files, rounded to steps of 1 / `toy_steps`."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np

from baker.core.encoding import ENCODINGS, DecodedImage, Encoding, EncodingOptions, check_pixels, write_image
from baker.core.errors import InputError
from baker.core.settings_model import setting

TOP = 1000.0


class ToyOptions(EncodingOptions):
    toy_steps: int = setting(8, "Steps of the toy format for a value of 1.", ge=1, le=64)


class ToyEncoding(Encoding[ToyOptions]):
    suffix = ".toy"
    components = (1, 3)
    options_type = ToyOptions
    when_clipped = "use the EXR"
    when_banded = "raise `toy_steps`"

    def limits(self, options):
        return 0.0, TOP

    def stored(self, pixels, options):
        steps = np.rint(np.clip(pixels, 0.0, TOP) * options.toy_steps)
        return (steps / options.toy_steps).astype(np.float32)

    def tolerance(self, pixels, options):
        return np.full(pixels.shape, 0.5 / options.toy_steps + 1e-4)

    def encode(self, path, pixels, *, options, header, names=None):
        check_pixels(pixels, self.components, path.name)
        stream = io.BytesIO()
        np.savez(stream, pixels=self.stored(pixels, options), header=json.dumps(dict(header)))
        write_image(path, stream.getvalue())

    def decode(self, path):
        try:
            with np.load(io.BytesIO(path.read_bytes())) as file:
                pixels, header = file["pixels"], json.loads(str(file["header"]))
        except OSError as error:
            raise InputError(f"the image cannot be read ({error.strerror})", file=str(path)) from None
        except (ValueError, zipfile.BadZipFile) as error:
            raise InputError(f"this is not a readable toy image ({error})", file=str(path)) from None
        return DecodedImage(pixels, header, "float", ("Y",) if pixels.shape[2] == 1 else ("R", "G", "B"))


ENCODINGS.register("toy")(ToyEncoding())
'''
# Start of a Python program. It adds its first argument to the folders that are searched for encodings.
START = "import sys, baker.encodings; baker.encodings.__path__.append(sys.argv.pop(1)); "
MAIN = START + "from baker.cli.__main__ import main; main()"
PAGE = START + "sys.path.insert(0, 'docs'); from make_settings_page import page; print(page())"


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "encodings"
    folder.mkdir()
    (folder / "toy.py").write_text(TOY)

    def start(program, *words):
        command = [sys.executable, "-c", program, str(folder), *map(str, words)]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)

    return start


def test_an_encoding_with_an_option_is_one_file(run, tmp_path):
    words = ["bake", "assets/cornell.glb", "-o", tmp_path / "out", "--resolution", 32, "--samples", 4]
    done = run(MAIN, *words, "--encode", "toy", "--toy-steps", 5, "-q")
    assert done.returncode == 0, done.stderr
    manifest = json.loads((tmp_path / "out" / "bake.json").read_text())
    assert manifest["settings"]["toy_steps"] == 5
    assert {entry["encoding"] for page in manifest["pages"] for entry in page["encodings"]} == {"toy"}
    assert any(w["code"] == "banding" and "raise `toy_steps`" in w["message"] for w in manifest["warnings"])
    with np.load(tmp_path / "out" / "ao_0.toy") as file:
        value = file["pixels"]
    assert np.array_equal(value * 5, np.rint(value * 5))
    assert set(np.unique(np.rint(value * 5))) <= set(range(6))

    config = tmp_path / "bake.toml"
    config.write_text("toy-steps = 65\n")
    refused = run(MAIN, *words, "--config", config, "--force")
    assert refused.returncode == 2
    assert "toy_steps" in refused.stderr
    assert "64" in refused.stderr


def test_an_option_is_in_help_and_docs(run):
    assert "--toy-steps" in run(MAIN, "bake", "--help").stdout
    page = run(PAGE).stdout
    meaning = "Steps of the toy format for a value of 1."
    row = f"| `--toy-steps` | `toy_steps` | `N` |  | 1 to 64 | `8` | {meaning} |"
    assert row in page
    assert "`toy` for maps with one value per texel or three colours" in page


@pytest.mark.parametrize("number", [1, 3])
def test_the_example_keeps_the_contract(number, tmp_path, monkeypatch):
    """The example that CONTRIBUTING.md names passes the contract tests of encodings."""
    ENCODINGS.names()
    monkeypatch.setattr(ENCODINGS, "_plugins", dict(ENCODINGS._plugins))
    (tmp_path / "toy.py").write_text(TOY)
    spec = importlib.util.spec_from_file_location("baker.encodings.toy", tmp_path / "toy.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "baker.encodings.toy", module)
    spec.loader.exec_module(module)
    case = "toy", number, module.ToyOptions()
    test_encodings.test_a_file_holds_every_value_within_the_stated_tolerance(tmp_path, *case)
    test_encodings.test_zero_and_the_largest_value_are_kept(tmp_path, *case)
    test_encodings.test_values_out_of_range_are_counted_and_clamped(tmp_path, *case)
    test_encodings.test_the_same_pixels_give_the_same_bytes(tmp_path, *case)
    test_encodings.test_odd_sizes(tmp_path, "toy")
    (tmp_path / "errors").mkdir()
    test_encodings.test_errors_are_sentences(tmp_path / "errors", "toy")
    test_encodings.test_suffixes_tell_encodings_apart()


def test_options_are_settings():
    options = encoding_options()
    assert {"exr", "rgbm"} <= set(options)
    names = [name for model in options.values() for name in model.model_fields]
    assert not set(names) & set(CommonSettings.model_fields)
    assert set(names) | set(CommonSettings.model_fields) == set(BakeSettings.model_fields)
    settings = BakeSettings(rgbm_range="3", dtype="float")
    assert ENCODINGS.get("rgbm").options_of(settings).top == 3.0
    assert ENCODINGS.get("exr").options_of(settings).model_dump() == {
        "dtype": "float",
        "exr_compression": "zip",
    }
