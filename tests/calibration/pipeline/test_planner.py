"""From a scene and pilot rates to a plan, and the command that does it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from synthetic_runs import line_network

from calibration.pipeline.pilot import pilot_rates
from calibration.pipeline.plan import StudyPlan, VerdictRules, is_plan
from calibration.pipeline.planned import HeldOutTest, PlanRequest
from calibration.pipeline.planner import chosen_runs, make_plan, rules_for
from calibration.validating.power import GroupPower
from kinetics.rates import Rates
from kinetics.sampling import sample_path

SIZES = {"monomer": 1, "dimer": 2, "trimer": 3, "quadmer": 4}
EVIDENCE = {"1+1->2": 150, "1+2->3": 120, "1+3->4": 60, "2+2->4": 50}


def pilot():
    """Table III with evidence, and breaks that come more often."""
    table = Rates.load("table3").as_dict(none=False)
    for name, channel in table["channels"].items():
        n = EVIDENCE.get(name, 30)
        channel["rate"] *= 1 if name in EVIDENCE else 10
        channel |= {"events": n, "exposure": n / channel["rate"]}
    return Rates(**table)


def seconds(spec):
    """A cost by size and length, the same on every machine."""
    return 1e-3 * spec.n_cubes * spec.duration


def request(**changes):
    asked = {"cubes": (24, 40), "held_out": (20, 30), "width": 0.2, "shift": 0.6, "along": (0.0, 100.0, 500.0)}
    asked |= {"duration": 200.0, "held_out_duration": 400.0}
    return PlanRequest(name="small", scene="line4", **(asked | changes))


@pytest.fixture(scope="module")
def planned():
    return make_plan(request(), pilot(), seconds)


def test_a_plan_reaches_what_is_asked_for(planned, tmp_path):
    assert planned.shortfalls == []
    assert planned.width <= 0.2
    assert set(planned.events) == {*EVIDENCE, "breaks"}
    planned.plan.save(tmp_path / "plan.toml")
    assert is_plan(tmp_path / "plan.toml")
    read = StudyPlan.load(tmp_path / "plan.toml")
    assert read == planned.plan
    for tanks in read.calibration.tanks:
        assert sum(SIZES[name] * n for name, n in tanks.composition.items()) in (24, 40)
    assert [tanks.composition for tanks in read.held_out.tanks] == [{"monomer": 20}, {"monomer": 30}]
    specs = read.specs(read.calibration)
    assert sum(map(seconds, specs)) == pytest.approx(planned.calibration_seconds)
    for test in planned.tests:
        assert test.power.power(planned.held_out_runs[test.cubes]) >= 0.9


def test_each_break_costs_more(planned):
    dearer = make_plan(request(each_break=True), pilot(), seconds)
    assert len(dearer.events) == 8
    assert dearer.width <= 0.2
    assert dearer.calibration_seconds > 1.5 * planned.calibration_seconds


def test_a_budget_that_does_not_reach(planned):
    hours = 0.5 * planned.calibration_seconds / 3600
    short = make_plan(request(cpu_hours=hours), pilot(), seconds)
    assert short.calibration_seconds + short.held_out_seconds <= 3600 * hours
    assert 0.2 < short.width < 0.6
    said = short.shortfalls[0]
    assert f"reaches a half-width of {short.width:.1%}" in said
    assert f"20.0% would cost {planned.calibration_seconds / 3600:.3g} hours" in said
    with pytest.raises(ValueError, match=r"are not enough for a run that shows each rate and 2 held-out runs"):
        make_plan(request(cpu_hours=1e-4), pilot(), seconds)


def test_what_no_number_of_runs_can_show(planned):
    refused = make_plan(request(width=0.3, shift=0.2), pilot(), seconds)
    breaks = [said for said in refused.shortfalls if "breaks off by 20% at 30 cubes" in said]
    assert len(breaks) == 1
    assert breaks[0].startswith("no number of held-out runs shows")
    width = float(breaks[0].split("a width of ")[1].split("%")[0]) / 100
    enough = make_plan(request(width=0.9 * width, shift=0.2, held_out=(30,)), pilot(), seconds)
    assert all(test.limit >= 0.9 for test in enough.tests)
    named = float(breaks[0].split("--width ")[1].split("%")[0]) / 100
    assert 0.8 * width < named < width
    assert make_plan(request(width=named, shift=0.2, held_out=(30,)), pilot(), seconds).shortfalls == []


def test_the_option_that_is_named_reaches_the_power(planned):
    """With the hours that a shortfall names, nothing falls short; the control has half of them."""
    hours = 0.6 * (planned.calibration_seconds + planned.held_out_seconds) / 3600
    short = make_plan(request(cpu_hours=hours), pilot(), seconds)
    named = max(float(said.split("--cpu-hours ")[1]) for said in short.shortfalls)
    assert make_plan(request(cpu_hours=named), pilot(), seconds).shortfalls == []
    assert make_plan(request(cpu_hours=0.5 * named), pilot(), seconds).shortfalls


def test_what_no_measurement_can_show_names_longer_runs():
    test = HeldOutTest(20, GroupPower("breaks", 0.0, np.inf, ((0.8, 0.0), (1.2, 0.0))), None, 0.0)
    found = replace(make_plan(request(), pilot(), seconds), tests=(test,), held_out_runs={20: 2})
    assert "give a longer --held-out-duration" in found.shortfalls[0]


def test_widths_that_tell_nothing_are_called_so(planned):
    few = replace(planned, runs=np.minimum(planned.runs, 1))
    assert f"Half-widths of {planned.width:.1%} or less for every join" in planned.plan.purpose
    none = replace(few, tanks=tuple(replace(tank, events=tank.events / 50) for tank in few.tanks))
    assert none.width > 1
    assert f"Half-widths of {none.width:.0%}, too wide to tell anything, for every join" in none.plan.purpose


def test_held_out_runs_within_a_budget():
    power = GroupPower("joins", 20.0, 0.02, ((0.8, 18.0), (1.2, 22.0)))
    tests = [HeldOutTest(20, power, 30, 1.0), HeldOutTest(40, power, 10, 1.0), HeldOutTest(40, power, None, 0.5)]
    costs = {20: 1.0, 40: 2.0}
    assert chosen_runs(tests, costs, np.inf) == {20: 30, 40: 10}
    assert chosen_runs(tests, costs, 24.0) == {20: 4, 40: 10}
    assert chosen_runs(tests, costs, 12.0) == {20: 6, 40: 3}, "what is left goes to both alike"
    assert chosen_runs(tests[:2], costs, 1e3) == {20: 30, 40: 10}, "and no further than is asked for"


def test_rules_are_as_coarse_as_the_shift(planned):
    """By default those of a plan that states none; rates off by twice the shift are beyond any of them."""
    assert rules_for(0.2) == VerdictRules()
    wide = rules_for(0.6)
    assert (wide.ratio, wide.pooled_ratio, wide.from_events) == ((0.55, 1.45), (0.7, 1.3), 16.7)
    assert planned.plan.verdict == wide


def test_another_tank(planned):
    double = make_plan(request(tank=(2.0, 2.0, 6.0)), pilot(), seconds)
    (first,) = double.plan.calibration.tanks[:1]
    assert double.plan.scene_of(first).tank.size == first.tank == (2.0, 2.0, 6.0)
    of_joins = [tank.events[:4].sum() for tank in double.tanks if tank.composition == {"monomer": 40}]
    whole = [tank.events[:4].sum() for tank in planned.tanks]
    assert of_joins[0] < 0.8 * max(whole)  # they meet half as often
    with pytest.raises(ValueError, match="do not state their tank"):
        make_plan(request(tank=(2.0, 2.0, 6.0)), pilot().replace(tank=None), seconds)


def test_a_book_with_a_seed_is_refused():
    with pytest.raises(ValueError, match="grows from a seed"):
        make_plan(PlanRequest(name="small", scene="pyramid45", cubes=(60,)), pilot(), seconds)


def test_the_figure(planned):
    ax = planned.plot(Figure().add_subplot())
    rows = [label.get_text() for label in ax.get_yticklabels()]
    assert rows == [*line_network().channels, "CPU minutes"]
    lengths = np.zeros(len(rows))
    for bars in ax.containers:
        lengths += [bar.get_width() for bar in bars]
    assert np.allclose(lengths, 1)


def test_pilot_rates():
    network = line_network()
    paths = [sample_path(network, network.state({"monomer": 30}), 20.0, seed=1, run=run) for run in range(3)]
    rates = pilot_rates(paths)
    assert rates.channels["1+1->2"].rate == pytest.approx(1e-3, rel=0.5)
    short = [sample_path(network, network.state({"monomer": 30}), 1e-9)]
    with pytest.raises(ValueError, match=r"never held the reactants of 1\+2->3, .* longer by --pilot-time"):
        pilot_rates(short)


def test_the_command(wellmixed_here, tmp_path):
    pilot().save(tmp_path / "pilot.toml")
    command = ["study", "plan", "line4", "--rates", "pilot.toml", "--cubes", 12, "--along", 0, 100, "--duration", 100]
    command += ["--held-out", 8, "--width", "40%", "--shift", "60%", "--out", "plan.toml", "--plot", "plan.svg"]
    data = wellmixed_here(*command, "--json", cwd=tmp_path).json
    plan = StudyPlan.load(tmp_path / "plan.toml")
    assert [(row["composition"], row["runs"]) for row in data["tanks"]] == [
        (tanks.composition, tanks.runs) for tanks in plan.calibration.tanks
    ]
    assert data["half_width"] == max(row["half_width"] for row in data["rates"]) <= 0.4
    assert {row["group"] for row in data["held_out"]} == {"joins", "breaks"}
    assert (tmp_path / "plan.svg").is_file()
    hours = 0.3 * data["calibration_cpu_seconds"] / 3600
    done = wellmixed_here(*command, "--cpu-hours", hours, "--strict", cwd=tmp_path)
    assert done.code == 2
    assert "falls short: the budget of" in done.err
    assert "plan written to plan.toml" in done.out
    assert StudyPlan.load(tmp_path / "plan.toml").calibration != plan.calibration  # the plan that fits


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--width", "0%"], "0% is no share between 0 and 1, such as 10%"),
        (["--width", "nan"], "nan is no share"),
        (["--power", "120%"], "120% is no share"),
        (["--shift", "some"], "some is no share"),
        (["--cpu-hours", "0"], "0.0 is not in the range x>0"),
        (["--cpu-hours", "nan"], "expected a finite number above 0"),
        (["--cpu-hours", "1e-9"], "are not enough for a run"),
        (["--duration", "inf"], "duration = inf; expected a finite number of tu above 0"),
        (["--held-out-duration", "-1"], "held_out_duration = -1.0; expected a finite number of tu above 0"),
        (["--along", "inf"], "along = [inf]; expected finite times of at least 0 tu"),
        (["--cubes", "4000"], "4000 cubes of edge 0.15 take 13.5; the tank holds 12"),
        (["--held-out", "0"], "0 is not in the range x>=1"),
        (["--cubes", "1"], "no tank on the path shows"),
        (["--rates", "norates"], "unknown rates 'norates'"),
        (["--out", "plan.txt"], "--out plan.txt: expected a name that ends in .toml"),
        (["--out", "no/plan.toml"], "the folder of no/plan.toml does not exist"),
        (["--tank", "2", "2", "0"], "greater than 0"),
    ],
)
def test_bad_input(wellmixed_here, tmp_path, options, said):
    base = {"--rates": ["table3"], "--cubes": [6], "--held-out": [6], "--along": [0], "--out": ["plan.toml"]}
    given = [word for name, values in (base | {options[0]: options[1:]}).items() for word in (name, *values)]
    done = wellmixed_here("study", "plan", "line4", *given, cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert said in " ".join(done.err.split())
    assert list(tmp_path.iterdir()) == []


def test_a_pilot_that_is_too_short(wellmixed_here, tmp_path):
    command = ["study", "plan", "line4", "--cubes", 4, "--pilot-time", 0.5, "--held-out", 6, "--out", "plan.toml"]
    done = wellmixed_here(*command, cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("pilot: 4 runs of 0.5 tu, about ")  # its cost comes first
    assert "the pilot runs never held the reactants of" in done.err
    assert json.dumps(sorted(path.name for path in tmp_path.iterdir())) == '["runs"]'
