"""What is no model that can be read: each fault is refused with its line, its column and what to do."""

import pytest

from kinetics.markov import read_prism

HEAD = "ctmc\n"
UP = "module m\n x : [0..3];\n [] x<3 -> 1 : (x'=x+1);\nendmodule\n"


def refusal(text, tmp_path, constants=None):
    (tmp_path / "model.sm").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"\w") as caught:
        read_prism(tmp_path / "model.sm", constants)
    return str(caught.value).removeprefix(f"{tmp_path}/model.sm, ")


def module(*lines):
    """A module of some lines, of which the first is line 3 of the model."""
    return HEAD + "module m\n" + "\n".join(lines) + "\nendmodule\n"


def test_the_models_that_are_spoiled_here_are_right(tmp_path):
    (tmp_path / "model.sm").write_text(HEAD + UP, encoding="utf-8")
    assert len(read_prism(tmp_path / "model.sm")) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        # types of models and parts that are not read
        ("dtmc\n" + UP, "line 1, column 1: a model of the type dtmc; only Markov chains in continuous time"),
        ("mdp\n" + UP, "line 1, column 1: a model of the type mdp"),
        ("// none\n" + UP, "line 6, column 1: the model states no type, and is then a Markov decision process"),
        ("pta\n" + UP, "line 1, column 1: a model of the type pta"),
        ("ctmc\nstochastic\n" + UP, "line 2, column 1: a second type of the model; the first is in line 1"),
        (HEAD, "line 2, column 1: there is no module"),
        ("", "line 1, column 1: the model states no type"),
        (HEAD + UP + "system m endsystem", "line 6, column 1: 'system' is not read: processes are composed by"),
        (HEAD + "observables x endobservables\n" + UP, "line 2, column 1: 'observables' is not read"),
        (HEAD + UP + "invariants", "line 6, column 1: 'invariants' came; expected const, formula, label"),
        (module("invariant x<3 endinvariant"), "line 3, column 1: an invariant belongs to timed automata"),
        # unbounded variables
        (module("x : int;"), "line 3, column 5: the variable 'x' has no bounds (int); give it a range"),
        (module("x : clock;"), "line 3, column 5: the variable 'x' has no bounds (clock)"),
        (module("x : [0..];"), "line 3, column 9: ']' came; expected an expression"),
        (module("x : [3..0];"), "line 3, column 6: 'x' goes from 3 to 0; expected a range that is not empty"),
        (module("x : [0..1e17];"), "line 3, column 9: a bound of 'x' is of the type double; expected int"),
        (module("x : [0..9007199254740993];"), "line 3, column 9: the number '9007199254740993' is too large"),
        (module("x : [0..y];", "y : [0..1];"), "line 3, column 9: a bound of 'x' depends on a variable"),
        (module("x : [0..3] init 4;"), "line 3, column 17: 'x' starts at 4; expected 0 to 3"),
        (module("x : [0..3] init true;"), "line 3, column 17: the start of 'x' is of the type bool; expected int"),
        # new values
        (module("x : [0..3];", "[] true -> 1 : (x'=1) & (x'=2);"), "line 4, column 26: 'x' is assigned twice"),
        (
            module("x : [0..3];", "[] true -> 1 : (x'=x+1);"),
            "line 4, column 21: 'x' is assigned 4; its range is 0 to 3 in the state x=3",
        ),
        (module("x : [0..3];", "[] x=0 -> 1 : (x'=5);"), "line 4, column 19: 'x' is assigned 5; its range is 0 to 3 i"),
        (module("x : [0..3];", "[] true -> 1 : (x'=x/2);"), "line 4, column 21: the new value of 'x' is of the type d"),
        (module("x : [0..3];", "[] true -> 1 : (y'=1);"), "line 4, column 17: 'y' is unknown; there are x"),
        (
            HEAD + "const int n = 1;\n" + UP.replace("(x'", "(n'"),
            "line 5, column 17: 'n' is no variable, and cannot be assigned",
        ),
        (module("x : [0..3];", "[] true -> 1 : x'=1;"), "line 4, column 16: 'x' came; expected an assignment"),
        # who may assign
        (
            HEAD + UP + "module k\n [] x>0 -> 1 : (x'=0);\nendmodule",
            "line 7, column 17: the module 'k' assigns 'x', which belongs to the module 'm'; make it global",
        ),
        (
            HEAD + "global g : [0..1];\n" + UP + "module k\n [a] g=0 -> 1 : (g'=1);\nendmodule",
            "line 8, column 18: a command with an action, [a], assigns the global variable 'g'",
        ),
        # constants
        (HEAD + "const int n;\n" + UP, "line 2, column 11: the constant 'n' has no value; give it one, as in --set n="),
        (HEAD + "const int n = 2.5;\n" + UP, "line 2, column 15: the constant 'n' is of the type int, its value of th"),
        (HEAD + "const int n = 6/2;\n" + UP, "line 2, column 16: the constant 'n' is of the type int, its value of th"),
        (HEAD + "const bool n = 1;\n" + UP, "line 2, column 16: the constant 'n' is of the type bool, its value of th"),
        (
            HEAD + "const int a = b;\nconst int b = c+1;\nconst int c = a;\n" + UP,
            "line 2, column 11: a constant depends on itself: a -> b -> c -> a",
        ),
        (HEAD + "const int n = x;\n" + UP, "line 2, column 15: the constant 'n' depends on a variable"),
        (HEAD + "const double n = 1e300*1e300;\n" + UP, "line 2, column 14: the constant 'n' is inf"),
        (HEAD + "const double n = 1/0;\n" + UP, "line 2, column 19: division by zero"),
        # formulas
        (HEAD + "formula f = g;\nformula g = f;\n" + UP, "line 2, column 9: a formula stands for itself: f -> g -> f"),
        (HEAD + "formula f = x + q;\n" + UP, "line 2, column 17: unknown name 'q'"),
        # names
        (module("x : [0..3];", "[] z<3 -> 1 : (x'=1);"), "line 4, column 4: unknown name 'z'; there are x"),
        (HEAD + "const int x = 1;\n" + UP, "line 4, column 2: the variable 'x' has the name of the constant in line 2"),
        (module("x : [0..3];", "x : [0..1];"), "line 4, column 1: the variable 'x' has the name of the variable in li"),
        (HEAD + UP + UP, "line 7, column 2: the variable 'x' has the name of the variable in line 3"),
        (HEAD + UP + "module m\nendmodule", "line 6, column 8: two modules are called 'm'"),
        (HEAD + UP + 'label "a" = x=1;\nlabel "a" = x=2;', "line 7, column 7: two labels are called 'a'"),
        (HEAD + UP + 'label "x" = x=1;', "line 6, column 7: the label 'x' has the name of a variable"),
        (HEAD + UP + 'label "deadlock" = x=1;', "line 6, column 7: the label 'deadlock' is there already"),
        (HEAD + UP + 'label "a b" = x=1;', "line 6, column 7: 'a b' is no name of a label"),
        (HEAD + UP + 'label "a = x=1;', "line 6, column 7: a quoted text does not end on its line"),
        (HEAD + UP + "label a = x=1;", "line 6, column 7: 'a' came; expected the name of a label in quotes"),
        (
            HEAD + UP + 'rewards "r" x=1 : 1; endrewards\nrewards "r" x=1 : 1; endrewards',
            "line 7, column 9: two rewards are called 'r'",
        ),
        (module("F : [0..3];"), "line 3, column 1: 'F' is a word of the language; it cannot be the name of a variable"),
        (HEAD + "const int module = 3;\n", "line 2, column 11: 'module' is a word of the language"),
        # copies
        (HEAD + UP + "module k = j [x=y] endmodule", "line 6, column 12: there is no module 'j' to copy; there are m"),
        (HEAD + UP + "module k = m [z=y] endmodule", "line 3, column 2: the variable 'x' has the name of the variable"),
        (HEAD + UP + "module k = m [x=y, x=z] endmodule", "line 6, column 20: 'x' is replaced twice"),
        (
            HEAD + UP + "module a = b [x=y] endmodule\nmodule b = a [y=z] endmodule",
            "line 7, column 12: a module is a copy of itself: a = b = a",
        ),
        (
            HEAD + "formula f = 1;\nformula g = 2;\n" + UP.replace("1 :", "f :") + "module k = m [x=y, f=g] endmodule",
            "line 8, column 20: 'f' is a formula, which is replaced by what it stands for before names are",
        ),
        # types
        (module("x : [0..3];", "[] x -> 1 : (x'=1);"), "line 4, column 4: a guard is of the type int; expected bool"),
        (module("x : [0..3];", "[] true -> x=1 : (x'=1);"), "line 4, column 13: a rate is of the type bool; expected"),
        (module("x : [0..3];", "[] x & true -> 1 : true;"), "line 4, column 6: '&' of the types int and bool"),
        (module("b : bool;", "[] b + 1 > 0 -> 1 : true;"), "line 4, column 6: '+' of the types bool and int; expected"),
        (module("b : bool;", "[] b = 1 -> 1 : true;"), "line 4, column 6: '=' of the types bool and int; expected two"),
        (module("b : bool;", "[] -b = 1 -> 1 : true;"), "line 4, column 4: a minus of the types bool"),
        (module("x : [0..3];", "[] mod(x, 1.5)=1 -> 1 : true;"), "line 4, column 4: 'mod' of the types int and double"),
        (HEAD + UP + 'label "a" = x;', "line 6, column 13: the label 'a' is of the type int; expected bool"),
        (HEAD + UP + "rewards true : x=1; endrewards", "line 6, column 17: a reward is true or false; expected a numb"),
        # values
        (module("x : [0..3];", "[] x<3 -> x-1 : (x'=x+1);"), "line 4, column 12: a rate is negative (-1); expected at"),
        (module("x : [0..3];", "[] x<3 -> 1/x : (x'=x+1);"), "line 4, column 12: division by zero in the state x=0"),
        (module("x : [0..3];", "[] x<3 -> pow(10.0,400) : true;"), "line 4, column 11: a power that does not exist"),
        (module("x : [0..3];", "[] x<3 -> pow(2,x-1) : true;"), "line 4, column 11: a whole number to a power below 0"),
        (module("x : [0..3];", "[] x<3 -> mod(1,x) : true;"), "line 4, column 11: the remainder of a division by zero"),
        (module("x : [0..3];", "[] x<3 -> log(x,2) : true;"), "line 4, column 11: a logarithm that does not exist"),
        (module("x : [0..3];", "[] x<3 -> 1e200*1e200 : true;"), "line 4, column 16: a rate is not finite"),
        (module("x : [0..3];", "[] x<3 -> 1e300 : (x'=x+1);"), "line 4, column 11: a rate is below 1e-290 or above"),
        (
            module("x : [0..3];", "[] x<3 -> (1e16+0.3)-1e16 : (x'=x+1);"),
            "line 4, column 21: a rate loses its digits, because large terms cancel",
        ),
        (HEAD + UP + "rewards true : x-1; endrewards", "line 6, column 17: a reward is negative (-1)"),
        (HEAD + UP + "rewards [go] true : 1; endrewards", "line 6, column 9: no command has the action 'go'; there ar"),
        (HEAD + UP + 'label "a" = 1/x > 1;', "line 6, column 14: division by zero in the state x=0"),
        # starts
        (HEAD + UP + "init x<2 endinit", "line 6, column 7: init ... endinit holds in 2 states (x=0; x=1, ...); a cha"),
        (HEAD + UP + "init x>5 endinit", "line 6, column 7: init ... endinit holds in 0 states; a chain starts in one"),
        (HEAD + UP + "init x=1 endinit\ninit x=2 endinit", "line 7, column 1: a second init; the first is in line 6"),
        (
            HEAD + UP.replace("3];", "3] init 0;") + "init x=1 endinit",
            "line 3, column 2: 'x' has a start of its own, and there is init ... endinit in line 6",
        ),
        (
            module("x : [0..9999];", "y : [0..9999];") + "init x+y=19998 endinit",
            "line 6, column 9: init ... endinit leaves over 2000000 states to be tried",
        ),
        # signs
        (module("x : [0..3];", "[] x=0 -> 1 : (x'=1)"), "line 5, column 1: 'endmodule' came; expected ';' behind a co"),
        (module("x : [0..3];", "[] x==0 -> 1 : (x'=1);"), "line 4, column 6: '=' came; expected an expression"),
        (module("x : [0..3];", "[] x=0 & -> 1 : (x'=1);"), "line 4, column 10: '->' came; expected an expression"),
        (module("x : [0..3];", "[] (x=0 -> 1 : (x'=1);"), "line 4, column 9: '->' came; expected ')' to close the bra"),
        (module("x : [0..3];", "[] x=0 -> 1 : (x'=1); # so"), "line 4, column 23: '#' means nothing"),
        (module("x : [0..3];", "<> x=0 -> 1 : (x'=1);"), "line 4, column 1: '<' came; expected a variable, a command"),
        (module("x : [0..3];", "[] sin(x)=0 -> 1 : (x'=1);"), "line 4, column 4: unknown function 'sin'; there are mi"),
        (module("x : [0..3];", "[] floor(x,1)=0 -> 1 : true;"), "line 4, column 4: floor of 2 arguments; expected 1"),
        (module("x : [0..3];", "[] x=0 => x=1 => x=2 -> 1 : true;"), "line 4, column 15: a => b => c is read in one w"),
        (HEAD + "module m\n x : [0..3];", "line 3, column 13: the end of the text came; expected a variable"),
        (HEAD + "const int n = " + "(" * 200 + "1" + ")" * 200 + ";\n" + UP, "over 100 expressions stand inside each"),
        (
            HEAD + "formula f0 = x;\n" + "".join(f"formula f{k} = f{k - 1} + f{k - 1};\n" for k in range(1, 40)) + UP,
            "an expression of over 100000 terms, formulas included",
        ),
        (
            HEAD + "".join(f"formula f{k} = f{k + 1} + 1;\n" for k in range(3000)) + "formula f3000 = x;\n" + UP,
            "over 150 terms stand inside each other, formulas included",
        ),
        (
            HEAD + "".join(f"const int c{k} = c{k + 1} + 1;\n" for k in range(3000)) + "const int c3000 = 1;\n" + UP,
            "over 150 terms stand inside each other, formulas included",
        ),
    ],
)  # fmt: skip
def test_it_is_refused_with_its_place(text, said, tmp_path):
    found = refusal(text, tmp_path)
    assert said in found
    if said.startswith("line"):
        assert found.startswith(said.split(":")[0])


@pytest.mark.parametrize(
    ("constants", "said"),
    [
        ({"n": 2, "k": 1}, "there is no constant 'k' to be set; those without a value are n, b"),
        (
            {"n": 2, "b": True, "fixed": 1},
            "line 4, column 11: the constant 'fixed' has a value in the text, and another",
        ),
        ({"n": 2.5, "b": True}, "the constant 'n' is of the type int and was given 2.5"),
        ({"n": True, "b": True}, "the constant 'n' is of the type int and was given True"),
        ({"n": "2", "b": True}, "the constant 'n' was given '2'; expected a number, or true or false"),
        ({"n": float("inf"), "b": True}, "the constant 'n' is inf; expected a finite number"),
        ({"n": 2, "b": 2}, "the constant 'b' is of the type bool and was given 2; expected 1 or 0"),
        ({"n": 2}, "line 3, column 12: the constant 'b' has no value"),
    ],
)
def test_constants_that_do_not_fit(constants, said, tmp_path):
    text = HEAD + "const int n;\nconst bool b;\nconst int fixed = 3;\n" + UP
    assert said in refusal(text, tmp_path, constants)


def test_files_that_are_no_texts(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        read_prism(tmp_path / "none.sm")
    (tmp_path / "bytes.sm").write_bytes(b"ctmc \xff")
    with pytest.raises(ValueError, match="is not UTF-8 text"):
        read_prism(tmp_path / "bytes.sm")
    (tmp_path / "large.sm").write_bytes(b" " * (2**24 + 1))
    with pytest.raises(ValueError, match="at most 16777216 are read"):
        read_prism(tmp_path / "large.sm")
