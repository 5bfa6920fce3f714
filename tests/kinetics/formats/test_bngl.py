"""BNGL files: what BioNetGen gets, and, where it is installed, the network that comes back."""

import importlib.util
import os
import shutil
import subprocess

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics.formats import read
from kinetics.formats.bngl import _program, bngl_files

MODEL = """begin model
begin parameters
 kp 0.01  # per second
 km 0.1
 A0 100
end parameters
begin molecule types
 A(b,s~u~p)
 B(a)
end molecule types
begin seed species
 A(b,s~u) A0
 B(a) 80
end seed species
begin observables
 Molecules AB A(b!1).B(a!1)
end observables
begin reaction rules
 bind: A(b) + B(a) <-> A(b!1).B(a!1) kp, km
 phos: A(b!+,s~u) -> A(b!+,s~p) 0.02
end reaction rules
end model
"""
# Stands for BioNetGen: says what it was given, and makes a network.
STAND_IN = """
open(my $in, '<', 'model.bngl'); my $text = join('', <$in>); close $in;
die "ABORT: $text" if $text =~ /refuse/;
open(my $out, '>', 'model.net');
print $out "begin parameters\\n 1 k 0.5\\nend parameters\\n";
print $out "begin species\\n 1 A() 7\\n 2 B() 0\\nend species\\nbegin reactions\\n 1 1 2 k\\nend reactions\\n";
"""

has_perl = pytest.mark.skipif(shutil.which("perl") is None, reason="there is no perl")
has_bionetgen = pytest.mark.skipif(
    "BNGPATH" not in os.environ and importlib.util.find_spec("bionetgen") is None, reason="BioNetGen is not installed"
)


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "model.bngl"
    file.write_text(MODEL, encoding="utf-8")
    return file


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    (tmp_path / "BNG2.pl").write_text(STAND_IN, encoding="utf-8")
    monkeypatch.setenv("BNGPATH", str(tmp_path))


WRITTEN = """
begin parameters
kp 0.01
km 0.1
A0 100
end parameters
begin molecule types
A(b,s~u~p)
B(a)
end molecule types
begin seed species
A(b,s~u) A0
B(a) 80
end seed species
begin observables
Molecules AB A(b!1).B(a!1)
end observables
begin reaction rules
bind: A(b) + B(a) <-> A(b!1).B(a!1) kp, km
phos: A(b!+,s~u) -> A(b!+,s~p) 0.02
end reaction rules
"""
GENERATE = """readFile({file=>"model.bngl",skip_actions=>1})
generate_network({overwrite=>1,prefix=>"model"})
"""


def written(path, text):
    return bngl_files(path, text)[0]


def with_line(block, line):
    """The model with one more line in a block, or behind all where the block has no name."""
    return MODEL.replace(f"end {block}\n", f"{line}\nend {block}\n") if block else MODEL + line + "\n"


def test_the_model_is_written_anew_without_actions(path):
    assert written(path, MODEL) == {"model.bngl": WRITTEN, "generate.bngl": GENERATE}
    acting = MODEL + "generate_network()\nbegin actions\nsimulate_nf({t_end=>2})\nend actions\n"
    files, actions = bngl_files(path, acting)
    assert files == written(path, MODEL)
    assert actions.has_others


@pytest.mark.parametrize(
    ("block", "line", "expected"),
    [
        ("parameters", "7 k2 = 2^(-kp) /\\\n  3 # and so on \\", "k2 2^(-kp)/3\n"),
        ("parameters", "lab: k2 1e-3*( if(kp>=2 && !km, min(1,2),_pi ) )", "k2 1e-3*(if(kp>=2&&!km,min(1,2),_pi))"),
        ("molecule types", "C(x~0~1,x~0~1) population", "C(x~0~1,x~0~1) population"),
        ("molecule types", "C", "C"),
        ("seed species", "3 $B(a!1).A(b!1,s~p) A0*2", "$B(a!1).A(b!1,s~p) A0*2"),
        ("observables", "Species  Two A()==2 , B(a!+)  {MatchOnce}A()", "Species Two A()==2,B(a!+),{MatchOnce}A()"),
        (
            "reaction rules",
            "0 -> B(a)  2*kp  DeleteMolecules priority = 3",
            "0 -> B(a) 2*kp DeleteMolecules priority=3",
        ),
        (
            "reaction rules",
            "A%x(b)->0 f(x) exclude_reactants(1,A(b!?),B())",
            "A%x(b) -> 0 f(x) exclude_reactants(1,A(b!?),B())",
        ),
        ("reaction rules", "$A() -> 0+B(a) Sat(kp,km)", "$A() -> 0 + B(a) Sat(kp,km)"),
        ("", "begin functions\nlab: f(x , y) AB(x)*y\ng=3\nend functions", "f(x,y) = AB(x)*y\ng() = 3"),
        ("", "begin compartments\nE 3 2*A0\nM 2 kp E\nend compartments", "E 3 2*A0 \nM 2 kp E"),
        ("", "begin energy patterns\nA(b!1).B(a!1) -kp\nend energy patterns", "A(b!1).B(a!1) -kp"),
        ("", "begin population maps\nB(a) -> P() kp\nend population maps", "B(a) -> P() kp"),
        ("", " Par  k9 = 3", "parameter k9 3"),
        ("", "setOption('NumberPerQuantityUnit',6e23);", 'setOption("NumberPerQuantityUnit",6e23)'),
    ],
)
def test_lines_are_written_anew(path, block, line, expected):
    text = with_line(block, line).replace("end model\n", "")
    assert f"\n{expected}\n" in written(path, text)["model.bngl"]


def test_lines_keep_their_numbers(path):
    """So that BioNetGen's messages name the user's lines; borders of the model are left out."""
    text = "\n# \u00b5\nbegin model\nbegin parameters\n k \\\n\\\n 3\n\n j 4\nend parameters\nend model\n"
    assert written(path, text)["model.bngl"].split("\n")[3:] == [
        "begin parameters",
        "k 3",
        "",
        "",
        "",
        "j 4",
        "end parameters",
        "",
    ]


def test_ends_of_lines_are_those_of_any_system_but_one(path):
    """BioNetGen takes a carriage return alone for a blank, which would hide what follows a comment."""
    assert written(path, MODEL.replace("\n", "\r\n")) == written(path, MODEL)
    with pytest.raises(ValueError, match=r"line 3: .*'\\r'"):
        written(path, MODEL.replace("kp 0.01", "kp\r0.01"))


@pytest.mark.parametrize(
    ("actions", "expected"),
    [
        ("generate_network({max_agg=>2, 'max_stoich'=>{A=>3,'B'=>4}});", "max_agg=>2,max_stoich=>{'A'=>3,'B'=>4}"),
        ("simulate({t_end=>3})\ngenerate_network({max_iter=>7})", "max_iter=>7"),
        ("generate_network({check_iso=>0,prefix=>'/x',print_iter=>1})", "check_iso=>0"),
        (
            'setParameter("kp", 3)\nsetConcentration("A(b,s~u)","A0*2")',
            "setParameter('kp','3')\nsetConcentration('A(b,s~u)','A0*2')",
        ),
        (
            "begin actions\n1 saveParameters()\nsetVolume('C',2.5)\nend actions",
            "saveParameters()\nsetVolume('C','2.5')",
        ),
        ('generate_network()\nsetParameter("kp", 3)', GENERATE),
    ],
)
def test_limits_and_settings_hold(path, actions, expected):
    assert expected in written(path, MODEL + actions + "\n")["generate.bngl"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("begin parameters", "begin parameter", "line 2: unknown block 'parameter'"),
        ("end parameters", "", "line 7: .*'begin molecule types'; expected 'end parameters'"),
        ("begin parameters", "", "line 3: 'kp 0.01' came"),
        ("end reaction rules\nend model\n", "", "block 'reaction rules' has no end"),
        ("km 0.1", "km tfun('secret', 't')", "line 4: a function from a file"),
        ("km 0.1", "km 2*TFUN(A0)", "line 4: a function from a file"),
        ("km 0.1", "km 0.1 `touch x`", "line 4: '`touch x`' came; expected the end of the line"),
        ("km 0.1", "km (0.1", "line 4: the line ends; expected '\\)'"),
        ("km 0.1", "km 1\u00b5", "line 4: the character"),
        ("km 0.1", "km 0.1\n0\nend parameters", "line 5: '0' came"),
        ("km 0.1", "beginning 0.1", "line 4: 'beginning 0.1' begins as a border"),
        ("km 0.1", "km 0.1" + "+1" * 50_001, "line 4: it has 100008 characters"),
        (MODEL, "# nothing\n", "no block of a model"),
        ("0.02", "0.02 TotalRate", "line 20: TotalRate"),
        ("0.02", "TotalRate 0.02", "line 20: TotalRate"),
        ("0.02", 'FunctionProduct("f","g")', "line 20: FunctionProduct"),
        ("0.02", "0.02 Reversibly", "line 20: 'Reversibly' came; expected a modifier"),
        ("A(b!+,s~u) ->", "A(b!+,s~u)==2 ->", "line 20: '==2': BioNetGen counts matches"),
        ("Molecules AB", "Counter AB", "line 16: the observable of kind 'Counter'"),
        ("B(a) 80", 'B(a) 80;system("x")', "line 13: .* came; expected the end"),
        ("end model", 'end model\nsetOption("x",`touch y`)', "line 23: '`touch y`\\)' came"),
        ("end model", 'end model\nsetOption("timeout",3)', "line 23: the option 'timeout'"),
        ("end model", "end model\nquit()\nsimulate()", "line 23: the action 'quit' before the network"),
        ("end model", "end model\nreadFile({file=>'x'})", "line 23: the action 'readFile'"),
        ("end model", "end model\nsetParameter('kp',\"3;system('x')\")", "line 23: .*; expected the end"),
        ("end model", "end model\nsetParameter('kp',do{3})", "line 23: .* came"),
        ("end model", "end model\ngenerate_network({max_agg=>kp})", "line 23: max_agg is 'kp'; expected a number"),
        ("end model", "end model\ngenerate_network({max_ag=>2})", "line 23: the argument 'max_ag'"),
        ("end model", "end model\ngenerate_network({max_agg=>2})\ngenerate_network()", "line 24: .*other limits"),
        (
            "end model",
            "generate_network()\nbegin functions\nend functions\nend model",
            "line 23: the block 'functions'",
        ),
        ("end model", "end model\nbegin functions\nend functions", "line 23: the block 'functions' behind the end"),
        ("end model", "end model\nbegin model", "line 23: 'begin model' stands where it cannot"),
        ("end model", "end model\nversion('2'); setParameter('kp',2)", "line 23: .*; expected the end"),
        ("end model", "end model\nsystem 'touch x'", "line 23: .* came; expected a block"),
    ],
)
def test_what_is_not_read_is_told_by_line(path, old, new, said):
    with pytest.raises(ValueError, match=said):
        written(path, MODEL.replace(old, new))


def test_amounts_that_are_concentrations_need_their_scale(path):
    path.write_text(MODEL + 'substanceUnits("Concentration")\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"line 23: substanceUnits .* --copies-per-unit"):
        read(path)
    assert bngl_files(path, MODEL + 'substanceUnits("Number")\n')[1].concentrations is None


@has_perl
def test_the_network_that_comes_back_is_read(path, stand_in):
    assert read(path).notes == ()
    path.write_text(MODEL + 'simulate({method=>"ssa"})\n', encoding="utf-8")
    model = read(path)
    assert model.initial.tolist() == [7, 0]
    assert "actions of the file are not carried out" in model.notes[-1]
    path.write_text(MODEL.replace("AB", "refuse"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"model\.bngl: BioNetGen refused it: .*refuse"):
        read(path)


@has_perl
def test_without_bionetgen_it_says_what_to_do(path, monkeypatch, tmp_path):
    monkeypatch.setenv("BNGPATH", str(tmp_path))
    with pytest.raises(ValueError, match=r"there is no BNG2\.pl"):
        read(path)
    monkeypatch.delenv("BNGPATH")
    monkeypatch.setattr("kinetics.support.packages.find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match="bionetgen"):
        read(path)
    monkeypatch.setattr("kinetics.formats.bngl._program", lambda: tmp_path)
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(ValueError, match="no perl here"):
        read(path)


@has_bionetgen
def test_the_network_of_rules(path):
    """By hand: A binds and lets go in both states, and changes state only while bound."""
    model = read(path)
    n = model.network
    assert len(n.species) == 5
    assert len(n.channels) == 5
    free, other = n.index("A(b,s~u)"), n.index("B(a)")
    state = np.zeros(5, dtype=int)
    state[[free, other]] = 3, 4
    assert_allclose(n.propensities(state).sum(), 0.01 * 3 * 4)
    assert model.initial[[free, other]].tolist() == [100, 80]
    assert sorted(model.observables["AB"]) == ["A(b!1,s~p).B(a!1)", "A(b!1,s~u).B(a!1)"]


@has_bionetgen
def test_limits_options_and_settings_change_the_network(path):
    """By hand: without complexes of two there is no reaction of them; two copies in 1e-23 units of volume meet once."""
    text = with_line("", 'setParameter("A0",7)\ngenerate_network({max_agg=>1})').replace("b!+,", "")
    path.write_text(text, encoding="utf-8")
    model = read(path)
    assert model.network.channels == ("phos",)
    assert sorted(model.initial) == [0, 7, 80]
    text = MODEL.replace("begin seed", "begin compartments\nC 3 1\nend compartments\nbegin seed").replace(
        " A(b,s~u) A0", " @C:A(b,s~u) A0"
    )
    text = text.replace(" B(a) 80", " @C:B(a) 80")
    path.write_text(f'setOption("NumberPerQuantityUnit",100)\n{text}', encoding="utf-8")
    model = read(path)
    assert_allclose(model.network.propensities(model.initial).sum(), 0.01 * 100 * 80 / 100)


@has_bionetgen
def test_a_network_that_is_cut_short_is_refused(path):
    """A chain that grows by one a round, which BioNetGen stops after 100 rounds unless the file says otherwise."""
    text = "begin parameters\nk 1\nend parameters\nbegin seed species\nB(p) 1\nend seed species\nbegin reaction rules\n"
    text += "B(p) -> B(p!1).C(q!1,p) k\nC(p) -> C(p!1).C(q!1,p) k\nend reaction rules\n"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="stopped before it came to an end; say by max_agg"):
        read(path)
    path.write_text(f"{text}generate_network({{max_iter=>4}})\n", encoding="utf-8")
    assert len(read(path).network.species) == 5


# Every part of the language that networks have, in the forms that users give it.
WHOLE = r"""version("2.2.0")
begin model
setOption("SpeciesLabel","HNauty")
parameter scale 2
begin parameters
 1 k1 = 1e-1*scale  # a comment \
 k2  (k1 + 3.)/ \
   2^-1
 lab: e1 -.5
end parameters
begin compartments
 out 3 10
 wall 2 k2/2 out
 in 3 1. wall
end compartments
begin molecule types
 L(r,r)
 R(l,s~u~p)
 X
end molecule types
begin seed species
 @out:L(r,r) 20
 @in:$X()  k1*10
end seed species
begin species
 R(l,s~u)@wall 5*scale
end species
begin observables
 Molecules all R(), L()
 Species  two R()==2
 Molecules inner R(s~p!?)
end observables
begin functions
 boost(x) = k1*if(inner(x)>=1, 2, 1)
 f = k2*all/(1+all)
 g() 2*f()
end functions
begin energy patterns
 R(l!1).L(r!1) e1
end energy patterns
begin reaction rules
 bind : L(r) + R(l) <-> L(r!1).R(l!1) Arrhenius(k1,k2)
 7 %c:R(s~u) -> %c:R(s~p) boost(c)
 R%m(s~p) -> R%m(s~u) f() \
   priority=2
 out1: @wall:{MatchOnce}R(l) -> 0 g()/3 DeleteMolecules
 0 -> @out:L(r,r) scale*2
 X() -> X() + X() k2 exclude_reactants(1,R())
end reaction rules
end model
setParameter("k1",0.7)
generate_network({overwrite=>1,max_agg=>4,max_iter=>3,max_stoich=>{L=>2}})
"""


@has_bionetgen
def test_bionetgen_makes_the_same_network_of_it(path, tmp_path):
    """As of the file itself, past all of our reading; but for the version that it asks for."""
    found = []
    for files, top in (({"model.bngl": WHOLE}, "model.bngl"), (written(path, WHOLE), "generate.bngl")):
        folder = tmp_path / f"of_{top}"
        folder.mkdir()
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8")
        done = subprocess.run(["perl", _program(), top], cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-500:] + done.stderr[-500:]
        lines = (folder / "model.net").read_text(encoding="utf-8").splitlines()
        found.append([line for line in lines if not line.startswith(("#", "version"))])
    assert found[0] == found[1]
    assert len(found[0]) > 50
