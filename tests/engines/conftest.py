"""Fixtures of the engine tests: one browser, and the exports of the probe and the room."""

from __future__ import annotations

import pytest
from browser import chromium
from engine_scenes import write_probe, write_room

from baker.core.export import EXPORTS

ALL = ",".join(EXPORTS.names())


@pytest.fixture(scope="session")
def browser():
    with chromium() as context:
        yield context


@pytest.fixture(scope="session")
def probe(tmp_path_factory):
    return write_probe(tmp_path_factory.mktemp("probe"), ALL)


@pytest.fixture(scope="session")
def room(tmp_path_factory):
    return write_room(tmp_path_factory.mktemp("room"), ALL)
