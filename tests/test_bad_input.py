"""A user's mistake: one message that says what came and what is allowed, exit code 2, nothing made or overwritten."""

import sys
from pathlib import Path

import pytest

from kinetics.support.packages import EXTRAS, how_to_install
from mechsim.world.engines import engine_named

ROOT = Path(__file__).parents[1]
SCENE = (ROOT / "mechsim" / "scenes" / "line4.toml").read_text(encoding="utf-8")
RATES = (ROOT / "kinetics" / "rates" / "tables" / "table3.toml").read_text(encoding="utf-8")
BOOK = (ROOT / "kinetics" / "assembly" / "books" / "line4.toml").read_text(encoding="utf-8")
CONTACT = '[[effects]]\neffect = "contact"\nrestitution = 0.3\nfriction = 0.3\n'
LATCH = 'kind = "encounter", probability = 0.09'

SIMULATE = ["simulate", "line4", "--cubes", "6", "--duration", "1"]
PREDICT = ["predict", "line4", "--rates", "table3"]
PASSAGE = ["passage", "line4", "--rates", "table3", "--cubes", "6"]
CALIBRATE = ["calibrate", "line4", "--out", "rates.toml"]
VALIDATE = ["validate", "line4", "--rates", "table3"]


def with_instead(command, more):
    """A command with other values of some of its options: two values of one are refused."""
    taken = [position for position, word in enumerate(command) if word in more and word.startswith("--")]
    return [word for n, word in enumerate(command) if n not in taken and n - 1 not in taken] + more


def changed(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


@pytest.fixture
def refused(wellmixed_here, tmp_path):
    """refused(*arguments): run a command that must be refused; returns its message on standard error.

    The folder it runs in holds a rates file and a finished picture, and must be the same afterwards. An error that the
    command does not report itself would be a traceback, and is raised here.
    """
    for name in ("rates.toml", "tank.png", "report.html"):
        (tmp_path / name).write_text(f"# an older {name}\n", encoding="utf-8")

    def contents():
        return {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}

    def run(*arguments):
        before = contents()
        done = wellmixed_here(*arguments, cwd=tmp_path)
        assert (done.code, done.out) == (2, "")
        assert (done.err.count("Error: "), done.err.count("Warning: ")) == (1, 0)
        assert len(done.err) < 2000
        assert contents() == before
        return done.err

    return run


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'effect = "walls"',
            'effect = "wals"',
            "unknown effect 'wals'; allowed are agitation, attraction, bonding",
        ),
        ('effect = "walls"', 'efect = "walls"', "'effects.2.effect' is missing"),
        ("sigma = 4.0", "sigm = 4.0", "unknown key 'effects.0.agitation.sigm'; did you mean 'sigma'?"),
        ("sigma = 4.0", "sigm = 4.0", "allowed here: effect, hold, sigma"),
        ("edge = 0.15", "edge = 0.15\nmass = 1.0", "unknown key 'cubes.mass'; allowed here: density, edge"),
        ("[tank]", "[tanks]", "unknown key 'tanks'; did you mean 'tank'?"),
        ("[tank]\nsize = [2.0, 2.0, 3.0]\n", "", "'tank' is missing"),
        ("edge = 0.15\n", "", "'cubes.edge' is missing"),
        (LATCH, 'kind = "magic"', "unknown kind 'magic'; allowed are encounter, delay"),
        (LATCH, 'kind = "delay"', "'effects.5.bonding.latch.delay.rate' is missing"),
        ('length = "paper"', 'length = "m"', "units.length = 'm': should be 'paper'"),
        ('time = "tu"', 'time = "s"', "units.time = 's': should be 'tu'"),
        ('density = "fluid"', 'density = "kg/m3"', "units.density = 'kg/m3': should be 'fluid'"),
        ('length = "paper"', 'lenght = "paper"', "allowed here: density, length, time"),
        ("edge = 0.15", "edge = -0.15", "cubes.edge = -0.15: should be a number greater than 0"),
        ("edge = 0.15", "edge = nan", "cubes.edge = nan: should be a finite number"),
        ("step = 0.00525", "step = inf", "numerics.step = inf: should be a finite number"),
        ("sigma = 4.0", "sigma = -inf", "effects.0.agitation.sigma = -inf: should be"),
        (
            "threshold = 0.006",
            "threshold = 0.0",
            "threshold = 0.0: should be a number greater than 0",
        ),
        (
            "probability = 0.09",
            "probability = 1.5",
            "= 1.5: should be a number greater than 0 and at most 1",
        ),
        ("sigma = 4.0", "sigma = true", "effects.0.agitation.sigma = True: should be a number"),
        ("sigma = 4.0", 'sigma = "4.0"', "effects.0.agitation.sigma = '4.0': should be a number"),
        ("solver_iterations = 50", "solver_iterations = 5.5", "numerics.solver_iterations = 5.5: should be"),
        ("size = [2.0, 2.0, 3.0]", "size = 2.0", "tank.size = 2.0: should be a list"),
        ("size = [2.0, 2.0, 3.0]", "size = [2.0, 2.0]", "tank.size = [2.0, 2.0]: should be a list of 3, each a number"),
        ("hold = 0.0105", "hold = 0.012", "agitation.hold = 0.012 is not a whole number of steps of 0.00525"),
        (CONTACT, "", "effect 'breaking' needs effect 'contact', which the scene does not list"),
        (CONTACT, CONTACT * 2, "effect 'contact' is listed twice"),
        ('rules = "line4"', 'rules = "line5"', "unknown rule book 'line5'; shipped are jack13, line4"),
        ('rules = "line4"', 'rules = "line5.toml"', "line5.toml does not exist"),
        ("sigma = 4.0", "sigma = ", "scene.toml is not valid TOML"),
        ("sigma = 4.0", f"sigma = {'[' * 3000}", "scene.toml is not valid TOML"),
        ("sigma = 4.0", f"sigma.{'a.' * 1900}b = 1", "tables within tables, too deep"),
        ("sigma = 4.0", f"sigma = {'9' * 3000}.0", "effects.0.agitation.sigma = inf: should be a finite number"),
        ("[tank]", f"{'a.' * 32000}b = 1\n[tank]", "characters; a line may have at most 4096"),
        ("[tank]", f"{'#' * 65536}\n[tank]", "at most 65536 are read"),
        ("[tank]", "\n".join(f"{'a.' * 2000}b{i} = 1" for i in range(15)) + "\n[tank]", "too deep"),
        ("[tank]", "\n".join(f"k{i} = 1" for i in range(5000)) + "\n[tank]", "and 4990 more"),
    ],
)
def test_scenes(refused, tmp_path, old, new, said):
    (tmp_path / "scene.toml").write_text(changed(SCENE, old, new), encoding="utf-8")
    assert said in refused("simulate", "scene.toml", *SIMULATE[2:])


@pytest.mark.parametrize("command", [SIMULATE, CALIBRATE, VALIDATE])
def test_every_command_reads_scenes_alike(refused, tmp_path, command):
    (tmp_path / "scene.toml").write_text(changed(SCENE, "hold = 0.0105", "hold = 0.012"), encoding="utf-8")
    assert "choose numerics.step = 0.006" in refused(command[0], "scene.toml", *command[2:])


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["--cubes", "100000"], "100000 cubes of edge 0.15 take 337.5; the tank holds 12"),
        (["--cubes", "-1"], "-1 is not in the range x>=1"),
        (["--cubes", "0"], "0 is not in the range x>=1"),
        (["--cubes", "nan"], "'nan' is not a valid integer"),
        (["--cubes", "6.5"], "'6.5' is not a valid integer"),
        (["--duration", "nan"], "duration = nan; expected a finite number of tu above 0"),
        (["--duration", "inf"], "duration = inf; expected a finite number"),
        (["--duration", "-1"], "duration = -1.0; expected a finite number of tu above 0"),
        (["--duration", "long"], "'long' is not a valid float"),
        (["--poses", "nan"], "poses = nan; expected a finite interval in tu above 0, or none"),
        (["--poses", "-1"], "poses = -1.0; expected a finite interval in tu above 0, or none"),
        (["--workers", "0"], "Invalid value for '--workers': 0 is not in the range x>=1"),
        (["--workers", "-1"], "Invalid value for '--workers': -1 is not in the range x>=1"),
        (["--runs", "0"], "0 is not in the range x>=1"),
        (["--seed", "-1"], "-1 is not in the range x>=0"),
        (["--initial", "monomer=6"], "either --cubes 60 or --initial monomer=20,dimer=20"),
        (["--without", "bondin"], "scene line4 lists agitation, drag, walls, contact, breaking, bonding"),
        (["--without", "contact"], "effect 'breaking' needs effect 'contact'"),
        (["--without", "bonding"], "the effect 'breaking', but there are no bonds to break"),
        (["--picture", "no/tank.png"], "the folder of no/tank.png does not exist"),
        (["--picture", "tank.doc"], "tank.doc must end in .png, .pdf, .svg"),
        (["--plot", "no/counts.svg"], "the folder of no/counts.svg does not exist"),
        (["--runs-folder", "rates.toml"], "'rates.toml' is a file"),
        (["--runs-folder", "rates.toml/runs"], "Not a directory"),
        (["--colour", "red"], "No such option"),
    ],
)
def test_simulate(refused, command, said):
    assert said in refused(*with_instead([*SIMULATE, "--picture", "tank.png"], command))


def test_cubes_that_fit_by_volume_but_not_at_random(refused, tmp_path):
    (tmp_path / "scene.toml").write_text(changed(SCENE, "edge = 0.15", "edge = 0.25"), encoding="utf-8")
    said = refused("simulate", "scene.toml", "--cubes", 700, "--duration", 1)
    assert "700 cubes of edge 0.25 do not fit at random into the tank 2 x 2 x 3: they are 91% of its volume" in said
    assert "take fewer or smaller cubes, or a larger tank" in said


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        ("quad=3", "unknown species 'quad'; book line4 has monomer, dimer, trimer, quadmer"),
        ("monomer", "--initial has 'monomer'; expected species=count"),
        ("monomer=-3", "--initial has 'monomer=-3'; expected species=count"),
        ("monomer=nan", "--initial has 'monomer=nan'; expected species=count"),
        ("monomer=1,monomer=2", "--initial names 'monomer' twice"),
        ("monomer=0", "the composition holds no cubes"),
    ],
)
def test_initial_species_of_simulate(refused, initial, said):
    assert said in refused("simulate", "line4", "--initial", initial)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            [*PREDICT, "--initial", "quad=3"],
            "unknown species 'quad'; the network has monomer, dimer, trimer, quadmer",
        ),
        ([*PREDICT, "--initial", "monomer=inf"], "--initial has 'monomer=inf'; expected species=count"),
        ([*PREDICT], "either --cubes 60 or --initial monomer=20,dimer=20"),
        ([*PREDICT, "--cubes", "0"], "0 is not in the range x>=1"),
        ([*PREDICT, "--cubes", "6", "--duration", "nan"], "--duration nan; expected a positive number of tu"),
        ([*PREDICT, "--cubes", "6", "--times", "10", "nan"], "times holds nan; expected finite numbers"),
        ([*PREDICT, "--cubes", "6", "--times", "10", "5"], "times must rise; 5 comes after 10"),
        ([*PREDICT, "--cubes", "6", "--times", "-5"], "times holds -5.0; expected at least 0"),
        ([*PREDICT, "--cubes", "6", "--method", "magic"], "'magic' is not one of 'ssa', "),
        ([*PREDICT, "--cubes", "6", "--csv", "no/table.csv"], "the folder of no/table.csv does not exist"),
        ([*PASSAGE, "--species", "quad"], "'quad' is neither a species nor an observable; did you mean quadmer?"),
        ([*PASSAGE], "Missing option '--species'"),
        (
            ["passage", "nobook", *PASSAGE[2:], "--species", "dimer"],
            "unknown rule book 'nobook'; shipped are jack13, line4",
        ),
        (["predict", "nobook", *PREDICT[2:], "--cubes", "6"], "unknown rule book 'nobook'; shipped are jack13, line4"),
        (["rules", "derive", "nobook"], "unknown rule book 'nobook'; shipped are jack13, line4"),
        (["simulate", "noscene", *SIMULATE[2:]], "unknown scene 'noscene'; shipped are line4"),
        (["simulate", "noscene.toml", *SIMULATE[2:]], "scene file noscene.toml does not exist"),
        (["calibrate", "noscene", *CALIBRATE[2:]], "unknown scene 'noscene'; shipped are line4"),
        (["validate", "noscene", *VALIDATE[2:]], "unknown scene 'noscene'; shipped are line4"),
        (with_instead(CALIBRATE, ["--out", "no/rates.toml"]), "the folder of no/rates.toml does not exist"),
        (with_instead(CALIBRATE, ["--out", "rates.txt"]), "--out rates.txt: expected a name that ends in .toml"),
        ([*CALIBRATE, "--report", "no/report.html"], "the folder of no/report.html does not exist"),
        ([*CALIBRATE, "--workers", "0"], "0 is not in the range x>=1"),
        ([*CALIBRATE, "--runs", "0"], "0 is not in the range x>=1"),
        ([*CALIBRATE, "--duration", "nan"], "duration = nan; expected a finite number of tu above 0"),
        ([*CALIBRATE, "--duration", "-5"], "duration = -5.0; expected a finite number of tu above 0"),
        ([*CALIBRATE, "--cubes", "4000"], "4000 cubes of edge 0.15 take 13.5; the tank holds 12"),
        ([*CALIBRATE, "--cubes", "60", "0"], "0 is not in the range x>=1"),
        ([*CALIBRATE, "--cubes", "2", "3"], "cubes = [2, 3]: too few for the reactants of 1+3->4, 2+2->4, 4->1+3, 4->"),
        (
            ["calibrate", "channels", "pyramid45", *CALIBRATE[2:]],
            "grows from a seed: a tank holds one growing structure, so its",
        ),
        (with_instead(VALIDATE, ["--rates", "norates"]), "unknown rates 'norates'; shipped are table3"),
        (with_instead(VALIDATE, ["--rates", "norates.toml"]), "rates file norates.toml does not exist"),
        ([*VALIDATE, "--cubes", "60", "4000"], "4000 cubes of edge 0.15 take 13.5; the tank holds 12"),
        ([*VALIDATE, "--cubes", "60", "0"], "0 is not in the range x>=1"),
        ([*VALIDATE, "--runs", "1"], "1 is not in the range x>=2"),
        ([*VALIDATE, "--duration", "inf"], "duration = inf; expected a finite number of tu above 0"),
        ([*VALIDATE, "--workers", "-1"], "-1 is not in the range x>=1"),
        ([*VALIDATE, "--report", "no/report.html"], "the folder of no/report.html does not exist"),
        (["demo", "--scale", "nan"], "--scale nan; expected a number from 0.02 to 100"),
        (["demo", "--workers", "0"], "0 is not in the range x>=1"),
        (["demo", "--folder", "rates.toml"], "'rates.toml' is a file"),
        (["runs", "export", "nofolder", "--out", "tables"], "'nofolder' does not exist"),
        (
            ["runs", "export", ".", "--out", "tables"],
            ". holds no runs; expected one that `wellmixed simulate`",
        ),
        (["assemble", "line4"], "No such command 'assemble'"),
    ],
)
def test_the_other_commands(refused, command, said):
    assert said in refused(*command)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (RATES[: RATES.index("[channels]")], "", "'convention' is missing"),
        ('combinations = "distinct"', "", "'convention.combinations' is missing"),
        ('combinations = "distinct"', 'combinations = "pairs"', "should be 'distinct', 'ordered' or 'product'"),
        (
            'time_unit = "tu"',
            'time_unit = "s"',
            "these rates are per s, and the network's time unit is tu",
        ),
        ('"1+1->2"', '"A+A->B"', "for another network (missing 1+1->2; not in the network: A+A->B)"),
        (
            "[convention]",
            'network = "0123"\n[convention]',
            "for another network: its channels have the same names, but",
        ),
        ("rate = 7.88e-5", "rate = -1.0", "channels.1+1->2.rate = -1.0: should be a number at least 0"),
        ("rate = 7.88e-5", "rate = nan", "channels.1+1->2.rate = nan: should be a finite number"),
        ("rate = 7.88e-5", "rate = inf", "channels.1+1->2.rate = inf: should be a finite number"),
        ("rate = 7.88e-5", 'rate = "7.88e-5"', "channels.1+1->2.rate = '7.88e-5': should be a number"),
        ("rate = 7.88e-5", "rat = 7.88e-5", "unknown key 'channels.1+1->2.rat'; did you mean 'rate'?"),
        (RATES[-60:], "", "mine.toml is not valid TOML"),
        (RATES, "\0", "mine.toml is not valid TOML"),
        (RATES, "", "'convention' is missing; 'channels' is missing"),
    ],
)
@pytest.mark.parametrize("command", [PREDICT, VALIDATE])
def test_rates(refused, tmp_path, command, old, new, said):
    (tmp_path / "mine.toml").write_text(changed(RATES, old, new), encoding="utf-8")
    assert said in refused(*command[:3], "mine.toml", "--cubes", "6")


def test_a_rule_book_of_other_reactions(refused, tmp_path):
    (tmp_path / "book.toml").write_text(BOOK, encoding="utf-8")
    renamed = changed(RATES, '"4->2+2" = { rate = 1.2e-5, ways = 1 }\n', "")
    (tmp_path / "mine.toml").write_text(renamed, encoding="utf-8")
    command = ["predict", "book.toml", "--rates", "mine.toml", "--cubes", "6"]
    assert "for another network (missing 4->2+2)" in refused(*command)
    (tmp_path / "book.toml").write_text(changed(BOOK, 'becomes = "b"', 'becomes = "x"'), encoding="utf-8")
    assert "book.toml" in refused(*command)


@pytest.mark.parametrize("seed", [1, 7])
def test_held_out_runs_need_a_seed_of_their_own(refused, tmp_path, seed):
    (tmp_path / "mine.toml").write_text(RATES.replace("[evidence]", f"[evidence]\nseed = {seed}"), encoding="utf-8")
    said = refused("validate", "line4", "--rates", "mine.toml", "--seed", seed)
    assert f"the rates were calibrated with seed {seed} too; held-out runs need another --seed" in said


def test_a_run_folder_of_another_version(refused, tmp_path):
    for part in ("claims", "quarantine"):
        (tmp_path / "runs" / part).mkdir(parents=True)
    (tmp_path / "runs" / "format").write_text("wellmixed runs, format 99\n", encoding="utf-8")
    (tmp_path / "runs" / "0.run").write_bytes(b"of another format")
    for command in (SIMULATE, CALIBRATE, [*VALIDATE, "--cubes", "6"], ["runs", "export", "runs", "--out", "tables"]):
        said = refused(*command)
        assert "holds 'wellmixed runs, format 99'; this version reads and writes 'wellmixed runs, format 2'" in said


def test_damaged_runs_are_set_aside_and_made_again(wellmixed, wellmixed_here, tmp_path):
    command = [*SIMULATE, "--runs", 3, "--json"]
    first = wellmixed_here(*command, cwd=tmp_path).json
    cut, altered, whole = (tmp_path / "runs" / f"{run['key']}.run" for run in first["runs"])
    data = altered.read_bytes()
    cut.write_bytes(cut.read_bytes()[:100])
    altered.write_bytes(data[:500] + bytes([data[500] ^ 1]) + data[501:])
    again = wellmixed(*command, cwd=tmp_path)
    for file, line in zip((cut, altered), again.err.splitlines(), strict=True):
        assert line.startswith("Warning: ")
        assert f"{file.name} is damaged" in line
        assert f"moved to {file.name}.damaged" in line
    assert (again.json["computed"], again.json["reused"]) == (2, 1)
    assert again.json["digest"] == first["digest"]
    files = {cut.name, altered.name, whole.name, f"{cut.name}.damaged", f"{altered.name}.damaged"}
    assert {path.name for path in (tmp_path / "runs").glob("*.run*")} == files
    assert wellmixed_here(*command, cwd=tmp_path).err == ""


def test_a_missing_extra_is_named(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    for name in ("mechsim.world.engines.pybullet_engine", "mechsim.world.world"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    told = refused(*SIMULATE)
    assert "this needs pybullet; install it by: pip install 'pybullet>=3.2.6' (Python 3.11 has wheels of it" in told
    assert told.rstrip().endswith("or add --engine own")
    # Where the command has no such option, it is not named.
    assert how_to_install("pybullet").endswith('engine = "own" under [numerics]')
    assert not set(engine_named("own").packages) & set(EXTRAS)


def test_debug_shows_the_traceback(wellmixed_here, tmp_path):
    with pytest.raises(ValueError, match="unknown rule book 'nobook'"):
        wellmixed_here("--debug", "rules", "derive", "nobook", cwd=tmp_path)
