"""An effect is added by one file and one line: shown in a scratch copy, in which the contract tests it at once."""

import pytest
from scratch import add_line, run_contract, scratch_copy

BREEZE = '''"""A breeze: a uniform flow that comes and goes."""

import math
from typing import Any, ClassVar

from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.view import ViewOfWorld


class Breeze(Effect, tag="breeze"):
    """u = speed sin(time) along x.

    speed : length / tu
    """

    needs: ClassVar[tuple[str, ...]] = ("drag",)
    example: ClassVar[dict[str, Any]] = {"speed": 0.5}
    speed: float

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """A flow that the clock sets."""
        return _Blowing(self, world)


class _Blowing(FlowSource):
    def __init__(self, settings: Breeze, world: ViewOfWorld):
        self.speed, self.world = settings.speed, world

    def before_step(self) -> None:
        self.flow[..., 0] = self.speed * math.sin(self.world.time)
'''
# Each is (in the place of, this) and the case of the contract that notices.
MISTAKES = (
    ("speed : length / tu", "", "test_it_documents_every_setting_and_the_unit_of_every_number"),
    ("speed: float", "speed: Any", "test_bad_settings_are_refused_by_name"),
    (
        "    def before_step(self) -> None:\n",
        "    def before_step(self) -> None:\n        self.world.fluid[..., 1] += 1.0\n",
        "test_it_only_writes_motions_before_the_step",
    ),
    (
        "math.sin(self.world.time)",
        "__import__('numpy').random.default_rng().random()",
        "test_the_same_seed_gives_the_same_record",
    ),
    (
        "        self.flow[..., 0] = ",
        "        self.flow[:] = self.world.fluid\n        self.flow[..., 0] += ",
        "test_as_a_source_of_flow_it_is_one_term_of_the_field",
    ),
)


@pytest.fixture
def copy(tmp_path):
    """A copy in which the new effect has its line."""
    made = scratch_copy(tmp_path)
    add_line(
        made / "mechsim" / "effects" / "__init__.py",
        "effects.breaking import",
        "from mechsim.effects.breeze import Breeze",
    )
    return made


def contract_of(copy, text):
    """The contract's cases for an effect that is this file; nothing is compiled for so few steps."""
    (copy / "mechsim" / "effects" / "breeze.py").write_text(text)
    return run_contract(copy, "test_effects.py", "-k", "breeze", "-rf", "--tb=no", plain=True)


def test_one_file_and_one_line_add_an_effect(copy):
    code, said = contract_of(copy, BREEZE)
    assert code == 0, said
    assert "16 passed" in said


def test_the_contract_notices_what_is_wrong_with_it(copy):
    """Control: five mistakes in the same file."""
    text = BREEZE
    for right, wrong, _ in MISTAKES:
        assert right in text
        text = text.replace(right, wrong)
    _, said = contract_of(copy, text)
    failed = {line.split("::")[1].split("[")[0] for line in said.splitlines() if line.startswith("FAILED")}
    assert failed >= {case for _, _, case in MISTAKES}, said
