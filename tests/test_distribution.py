"""`tests/conftest.py` distributes the tests: tests that share a fixture run in one process."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module")
def shared():
    return object()


def test_tests_that_share_a_fixture_are_one_group(shared, request):
    # pytest-xdist appends the group to the name of the test. With pytest 9.2, the name did not change, and
    # shared fixtures were made once in each process.
    if not request.config.getoption("loadgroup", False):
        pytest.skip("only with pytest -n 2 --dist loadgroup")
    assert request.node.nodeid.endswith("@tests/test_distribution.py")
