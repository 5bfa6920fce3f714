"""The same models, read and answered by Storm, where it is installed (extra `oracle`): its own case studies and ours.

Storm answers questions without a time in rational numbers where states are few. Its values up to a time are asked for
to 1e-13; totals of rewards up to a time it still gives to about 1e-7 only (ours agree with a matrix exponential to
1e-11, tests in test_reading.py).
"""

from pathlib import Path

import pytest

from kinetics.markov import ask, read_prism

MODELS = Path(__file__).parent / "models"
THEIRS = "theirs"
CASES = [
    (THEIRS, "ctmc/tiny.sm", {}, ('P=? [ F<=1 "full" ]', 'S=? [ "full" ]')),
    (
        *(THEIRS, "ctmc/tandem5.sm", {}),
        ('P=? [ F<=1 "network_full" ]', 'S=? [ "network_full" ]', 'R{"customers"}=? [ S ]', 'R{"customers"}=? [ I=1 ]'),
    ),
    (
        *(THEIRS, "ctmc/polling2.sm", {}),
        ('S=? [ "target" ]', 'R{"served"}=? [ S ]', "P=? [ !(s=2 & a=1) U s=1 & a=1 ]", 'R{"served"}=? [ C<=5 ]'),
    ),
    (THEIRS, "pctmc/polling3.sm", {"mu": 1.0, "gamma": 200.0}, ("S=? [ s1=1 & !(s=1 & a=1) ]", 'R{"waiting"}=? [ S ]')),
    (THEIRS, "ctmc/embedded2.sm", {}, ('P=? [ F<=43200 "down" ]',)),
    (THEIRS, "ctmc/fms2.sm", {}, ("P=? [ F<=10 P12s=2 ]", 'R{"throughput_m1"}=? [ C<=10 ]')),
    (THEIRS, "ctmc/cluster2.sm", {}, ('P=? [ F<=1000 !"minimum" ]', 'S=? [ "premium" ]', 'R{"num_repairs"}=? [ S ]')),
    ("", "polling4.sm", {}, ('S=? [ "first" ]', 'R{"waiting"}=? [ S ]', 'P=? [ F<=3 "first" ]')),
    ("", "tandem.sm", {"c": 4}, ('S=? [ "full" ]', 'R{"customers"}=? [ S ]', 'R{"customers"}=? [ I=2 ]')),
    ("", "sharing.sm", {}, ('P=? [ F<=0.5 "done" ]', 'R{"missing"}=? [ F "done" ]')),
    ("", "reservation.sm", {}, ('P=? [ F<=20 "alarm" ]', 'R{"work"}=? [ C<=3 ]')),
    ("", "enzyme.sm", {}, ('P=? [ F<=100 "eaten" ]', 'R{"turns"}=? [ F "eaten" ]')),
    ("", "birth.sm", {"n": 10}, ("P=? [ F<=20 jobs=10 ]", "S=? [ jobs=0 ]")),
    (
        "",
        "receptor.sm",
        {},
        ('P=? [ F<=60 "degraded" ]', 'R{"signal"}=? [ F "degraded" ]', 'P=? [ hold<2 U "degraded" ]'),
    ),
]


@pytest.fixture(scope="module")
def storm():
    stormpy = pytest.importorskip("stormpy", reason="Storm is an extra: pip install wellmixed[oracle]")
    stormpy.developer.set_log_level(stormpy.developer.LogLevel.OFF)
    stormpy.developer.set_from_exploded_string(["--timebounded:precision", "1e-13"])
    return stormpy


@pytest.mark.parametrize(("whose", "file", "constants", "questions"), CASES, ids=[case[1] for case in CASES])
def test_states_and_answers(storm, whose, file, constants, questions):
    path = Path(storm.__file__).parent / "examples" / "files" / file if whose else MODELS / file
    program = storm.parse_prism_program(str(path), prism_compatibility=True)
    parsed = storm.parse_properties(";".join(questions), program)
    if constants:
        program, parsed = storm.instantiate_constants(program, constants, parsed)
    model = storm.build_model(program, parsed)
    chain = read_prism(path, constants)
    assert len(chain) == storm.build_model(program).nr_states
    for question, each in zip(questions, parsed, strict=True):
        is_timed = any(bound in question for bound in ("F<=", "I=", "C<="))
        built = model if is_timed else storm.build_model[storm.Rational](program, parsed)
        exact = float(storm.model_checking(built, each).get_value(built.initial_states[0]))
        within = 1e-6 if "C<=" in question else 1e-9
        value = ask(chain, question).value
        assert value == pytest.approx(exact, rel=within, abs=0.0), question
        assert value * (1 + 3 * within) != pytest.approx(exact, rel=within, abs=0.0)  # the control
