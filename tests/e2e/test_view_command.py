"""`baker view` on the command line prints its address, answers requests, and ends with Ctrl-C."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from io import StringIO
from urllib.request import urlopen

import pytest
from view_bake import make_bake

from baker.cli.app import run

BAKER = [sys.executable, "-c", "from baker.cli.app import main; main()"]


@pytest.mark.timed
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_until_it_is_stopped(tmp_path, number):
    out = make_bake(tmp_path / "level (1) ü")
    command = [*BAKER, "view", str(out), "--json"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    )
    try:
        told = ""
        while not told.endswith("}\n"):
            line = process.stdout.readline()
            assert line, process.stderr.read()
            told += line
        found = json.loads(told)
        assert found["out"] == str(out)
        with urlopen(found["url"] + "scene.json", timeout=10) as answer:
            assert json.load(answer)["pages"] == 2
        start = time.monotonic()
        process.send_signal(number)
        rest, text = process.communicate(timeout=10)
        assert time.monotonic() - start < 3  # documented: one second on an idle machine
    finally:
        process.kill()
    assert process.returncode == 0
    assert rest == ""  # standard output had a single JSON object
    assert "Traceback" not in text


@pytest.mark.parametrize(
    ("argv", "code", "said"),
    [
        (["nowhere"], 3, "there is no such folder"),
        (["empty"], 3, "holds no bake"),
        (["out", "--three", "empty"], 3, "no three.js here"),
        (["out", "--port", "70000"], 2, "port"),
        (["out", "--seed", "x"], 2, "seed"),
        ([], 2, "OUT"),
    ],
)
def test_what_cannot_be_shown_is_said(tmp_path, monkeypatch, argv, code, said):
    monkeypatch.chdir(tmp_path)
    make_bake(tmp_path)
    (tmp_path / "empty").mkdir()
    stream = StringIO()
    assert run(["view", *argv, "--json", "--no-browser"], out=stream) == code
    assert said in json.loads(stream.getvalue())["error"]["message"]
