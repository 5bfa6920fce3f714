"""A tank's volume, surface and their ratio are numbers, or it is refused where it is made."""

import math
import re

import pytest
from command_line import run_here

from kinetics import ChannelRate, Convention, Network, Rates
from kinetics.assembly import RuleBook, derive
from kinetics.network import Tank
from mechsim import Scene

REFUSED = [
    ((1e-200, 1e-200, 1e-200), "has the volume 0 and the surface 0"),
    ((1e300, 1e300, 1e300), "has the volume inf and the surface inf"),
    ((1e-300, 1e300, 1.0), "has the volume 1 and the surface 2e+300"),
    ((5e-324, 1.0, 1.0), "has the volume 4.94e-324"),
    ((math.nan, 1.0, 1.0), "tank holds nan; expected finite numbers"),
    ((math.inf, 1.0, 1.0), "tank holds inf; expected finite numbers"),
    ((-1.0, 1.0, 1.0), "tank holds -1.0; expected at least 0"),
    ((0.0, 1.0, 1.0), "expected three lengths above 0"),
]


@pytest.mark.parametrize(("size", "said"), REFUSED)
def test_what_no_tank_can_be_is_refused(size, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        Tank(size)


@pytest.mark.parametrize(
    "size", [(1e-20, 1e-20, 1e-19), (1e19, 1e19, 1e19), (1e-25, 1e-25, 1e40), (2.0, 2.0, 3.0), (1e-6, 1e-6, 1e-6)]
)
def test_factors_between_the_tanks_that_are_taken_are_numbers(size):
    one, other = Tank(size), Tank((1.0, 2.0, 3.0))
    for factor in (one.dilution(other), other.dilution(one), one.wall_factor(other), other.wall_factor(one)):
        assert 0.0 < factor**2 < math.inf


@pytest.mark.parametrize("size", [size for size, _ in REFUSED])
def test_the_command_refuses_it_without_a_warning(size, tmp_path):
    asked = ("--rates", "table3", "--cubes", 4, "--runs", 2, "--times", 1, "--tank", *size)
    done = run_here("predict", "line4", *asked, cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert "tank" in done.err
    assert "Warning" not in done.err


@pytest.mark.parametrize("edge", [1e-200, 1e-30, 1e150, 1e300])
def test_a_scene_makes_the_same_check(edge):
    scene = Scene.load("line4")
    with pytest.raises(ValueError, match=r"tank = .* expected that both and their ratio lie"):
        scene.replace(tank={"size": [edge, edge, edge]})
    with pytest.raises(ValueError, match="edge"):
        scene.replace(cubes={"edge": edge, "density": 1.0})


def test_a_rate_constant_that_another_tank_takes_beyond_a_float_is_named():
    line = derive(RuleBook.load("line4")).network
    rates = Rates.load("table3")
    slow = rates.replace(channels={name: one.replace(rate=one.rate * 1e-300) for name, one in rates.channels.items()})
    assert slow.apply(line, Tank((2.0, 2.0, 3.0))).rate_constants.min() > 0.0
    with pytest.raises(ValueError, match=r"channel '1\+1->2': its rate constant \S*e-305, of a tank of 2 x 2"):
        slow.apply(line, Tank((1e10, 1e10, 1e10)))
    with pytest.raises(ValueError, match="beyond what a float holds; use tanks more alike"):
        slow.posterior(line, Tank((1e10, 1e10, 1e10)))


def test_many_bodies_meet_beyond_a_float():
    """Three at once: the square of the ratio of the volumes."""
    network = Network.from_text("trio: 3 A -> B, 1e-80")
    measured = {"trio": ChannelRate(rate=1e-80, ways=1)}
    rates = Rates(convention=Convention(combinations="distinct"), tank=(1e-19,) * 3, channels=measured)
    assert rates.apply(network, Tank((1e5, 1e5, 1e5))).rate_constants[0] == pytest.approx(1e-224)
    with pytest.raises(ValueError, match="channel 'trio': its rate constant 1e-80"):
        rates.apply(network, Tank((1e19, 1e19, 1e19)))
