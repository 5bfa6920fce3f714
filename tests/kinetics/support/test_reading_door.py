"""What the door of files that are read takes and refuses, and that every reader of the user's files goes through it."""

import json
import os
import threading
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from calibration.observed.tables import read_table
from calibration.pipeline.plan import StudyPlan
from kinetics.assembly import RuleBook
from kinetics.assembly.compiler import Target
from kinetics.formats import read
from kinetics.markov import read_explicit
from kinetics.rates import Rates
from kinetics.support.config import read_toml
from kinetics.support.limits import bytes_in, check_names, text_in
from mechsim.scene import Scene

MARK = "\ufeff"
ROOT = Path(__file__).parents[3]
NET = "begin species\n1 A() 3\nend species\nbegin reactions\n1 1 0 0.5\nend reactions\n"
XML = (
    '<?xml version="1.0" encoding="UTF-8"?>'
    '<sbml xmlns="http://www.sbml.org/sbml/level2/version4" level="2" version="4"><model>'
    '<listOfCompartments><compartment id="c" size="1"/></listOfCompartments><listOfSpecies><species id="A" '
    'compartment="c" initialAmount="3" hasOnlySubstanceUnits="true"/></listOfSpecies><listOfReactions><reaction '
    'id="r" reversible="false"><listOfReactants><speciesReference species="A"/></listOfReactants><kineticLaw><math '
    'xmlns="http://www.w3.org/1998/Math/MathML"><ci>A</ci></math></kineticLaw></reaction></listOfReactions></model></sbml>'
)
NETWORKS = {"m.rxn": "A -> 0, 0.5\nA = 3\n", "m.net": NET, "m.xml": XML, "m.sbml": XML, "m.ant": "r: A -> ; A; A = 3"}
# Kind of file -> its text, and what reads it.
CONFIGURATIONS = {
    "book": (ROOT / "kinetics/assembly/books/line4.toml", RuleBook.load),
    "target": (ROOT / "kinetics/assembly/targets/cube2.toml", Target.load),
    "rates": (ROOT / "kinetics/rates/tables/table3.toml", Rates.load),
    "scene": (ROOT / "mechsim/scenes/line4.toml", Scene.load),
    "plan": (ROOT / "results/line4/plan.toml", StudyPlan.load),
}


@pytest.mark.parametrize("name", NETWORKS)
def test_a_byte_order_mark_of_a_network_file_is_skipped(name, tmp_path):
    (tmp_path / name).write_text(MARK + NETWORKS[name], encoding="utf-8")
    model = read(tmp_path / name)
    assert model.network.species == ("A",)
    assert_array_equal(model.initial, [3])


def test_a_byte_order_mark_of_explicit_files_is_skipped(tmp_path):
    files = {
        "m.tra": "2 2\n0 1 1\n1 0 1\n",
        "m.sta": "(x)\n0:(5)\n1:(6)\n",
        "m.lab": '0="init" 1="up"\n1: 0 1\n',
        "m.srew": '# Reward structure "gain"\n2 1\n1 2.5\n',
        "m.trew": "2 1\n0 1 3\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(MARK + text, encoding="utf-8")
    chain = read_explicit(tmp_path / "m.tra")
    assert chain.variables == ("x",)
    assert list(chain.labels) == ["init", "up", "deadlock"]
    assert list(chain.rewards) == ["gain"]
    assert_array_equal(chain.initial, [0, 1])


@pytest.mark.parametrize("kind", CONFIGURATIONS)
def test_a_byte_order_mark_of_a_toml_file_is_skipped(kind, tmp_path):
    source, load = CONFIGURATIONS[kind]
    text = source.read_text(encoding="utf-8")
    copy = tmp_path / source.name
    copy.write_text(MARK + text, encoding="utf-8")
    assert read_toml(copy) == read_toml(source)
    assert type(load(copy)) is type(load(source))


def test_a_byte_order_mark_of_options_tables_and_certificates_is_skipped(tmp_path, wellmixed_here):
    (tmp_path / "o.toml").write_text(f"{MARK}[rules.derive]\njson = true\n", encoding="utf-8")
    (tmp_path / "m.rxn").write_text("A -> B, 1", encoding="utf-8")
    done = wellmixed_here("--config", str(tmp_path / "o.toml"), "rules", "derive", "m.rxn", cwd=tmp_path)
    assert json.loads(done.out)["species"] == ["A", "B"]
    (tmp_path / "t.csv").write_text(f"{MARK}run,time\n1,2\n", encoding="utf-8")
    assert list(read_table(tmp_path / "t.csv").columns) == ["run", "time"]


def test_a_pipe_is_read_up_to_the_limit(tmp_path):
    path = tmp_path / "pipe.rxn"
    os.mkfifo(path)

    def fed(data, act):
        def feed():
            with path.open("wb") as pipe:
                try:
                    pipe.write(data)
                except BrokenPipeError:
                    return

        feeder = threading.Thread(target=feed)
        feeder.start()
        try:
            return act()
        finally:
            feeder.join()

    assert_array_equal(fed(b"A -> B, 2\nA = 4\n", lambda: read(path)).initial, [4, 0])
    assert len(fed(b"x" * 3_000_000, lambda: bytes_in(path))) == 3_000_000
    with pytest.raises(ValueError, match=r"pipe\.rxn has more than 1000 bytes; at most that many are read"):
        fed(b"x" * 3_000_000, lambda: text_in(path, 1000))


def test_what_is_no_file_is_told(tmp_path):
    (tmp_path / "folder.rxn").mkdir()
    (tmp_path / "device.rxn").symlink_to("/dev/zero")
    for name, kind in (("folder.rxn", "a folder"), ("device.rxn", "a terminal or a device")):
        for act in (read, lambda path: read_toml(Path(path)), text_in):
            with pytest.raises(ValueError, match=rf"{name} is {kind}; expected a file, or a pipe"):
                act(tmp_path / name)
    with pytest.raises(ValueError, match=r"none\.rxn does not exist"):
        text_in(tmp_path / "none.rxn")


HIDDEN = ["\0", "\x1b", "\x7f", "\x85", "\x9b", "\ud800", "\udfff", "\u061c", "\ufeff"]
HIDDEN += map(chr, (0x200E, 0x200F, 0x2028, 0x2029, *range(0x202A, 0x202F), *range(0x2066, 0x206A)))


@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda hidden: f"U+{ord(hidden):04X}")
def test_names_that_cannot_be_seen_are_refused_with_their_number(hidden, tmp_path):
    for name in (f"a{hidden}b", hidden):
        with pytest.raises(ValueError, match=rf"U\+{ord(hidden):04X}") as refused:
            check_names(Path("m.rxn"), ["fine", name])
        assert hidden not in str(refused.value)
    check_names(Path("m.rxn"), ["A(b!1).B(a!1)", "é", "名前", "a b", "😀", "مرحبا"])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("species.rxn", "'a\\u202eb' -> B, 1"),
        ("channel.rxn", "'a\\x1b[31m': A -> B, 1"),
        ("observable.rxn", "A -> B, 1\nobservable: 'a\\x9b' = A"),
        ("parameter.rxn", "A -> B, 'k\\u200f'\n'k\\u200f' = 1"),
        ("unit.rxn", "A -> B, 1\ntime unit: s\u202e"),
        ("label.net", NET.replace("0.5", "0.5 #a\u202e")),
        ("species.net", NET.replace("A()", "A(\x1b)")),
        ("m.lab", '0="init" 1="u\u202ep"\n1: 0 1\n'),
        ("m.sta", "(x\u202e)\n0:(5)\n1:(6)\n"),
        ("m.srew", '# Reward structure "ga\u202ein"\n2 1\n1 2.5\n'),
        ("book.toml", 'name = "a\\u202e"\n'),
        ("key.toml", '"a\\u001b" = 1\n'),
        ("cell.csv", "run,channel\n1,a\u202eb\n"),
        ("title.csv", "run,cha\u202ennel\n1,a\n"),
    ],
)
def test_every_reader_refuses_them(name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    (tmp_path / "m.tra").write_text("2 2\n0 1 1\n1 0 1\n", encoding="utf-8")
    readers = {".toml": read_toml, ".csv": read_table, ".rxn": read, ".net": read}
    with pytest.raises(ValueError, match=r"U\+(202E|001B|009B|200F)") as refused:
        readers.get(path.suffix, lambda _: read_explicit(tmp_path / "m.tra"))(path)
    assert str(tmp_path) in str(refused.value)
