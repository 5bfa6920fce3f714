"""The tests of this room run for each engine."""

import pytest

from mechsim.scene import Scene
from mechsim.world.engines import ENGINES


@pytest.fixture(scope="session", params=ENGINES, ids=lambda entry: entry.name)
def line4(request):
    """The shipped scene, computed by one engine after the other."""
    data = Scene.load("line4").model_dump(mode="json")
    data["numerics"]["engine"] = request.param.name
    return Scene.model_validate(data)
