"""The tests of this room run for each engine."""

import pytest

from mechsim.world.engines import ENGINES


@pytest.fixture(scope="session", params=[entry.name for entry in ENGINES])
def line4(request, by_engine):
    """The shipped scene, computed by one engine after the other."""
    return by_engine(request.param)
