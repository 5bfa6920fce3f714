"""Hostile BNGL and Antimony files, which try to have another program create, change or read a file; and what would.

They end blocks, hide imports and call Perl by comments, lines that go on, case, blanks, labels, quotes and encodings.
"""

import re
from pathlib import Path

from tests.helpers.canary_judges import dangers, imports
from tests.helpers.fuzzed_inputs import Inputs

SECRET = "leaked42"  # a name in both files that must not be read
MODEL = """begin model
begin parameters
k 1
end parameters
begin molecule types
A(b)
end molecule types
begin seed species
A(b) 10
end seed species
begin observables
Molecules O A(b)
end observables
begin functions
f() k*O
end functions
begin reaction rules
A(b) -> 0 k
end reaction rules
end model"""
# Perl that BioNetGen would evaluate; DIR is the folder with the canaries.
PERL = [
    'setModelName(do{system("touch DIR/made");"m"})',
    'setModelName(do{open(F,">DIR/made");1})',
    "setModelName(`touch DIR/made`)",
    'setOption("x",do{unlink("DIR/kept");1})',
    'setOption("NumberPerQuantityUnit",do{system("touch DIR/made");2})',
    'setOption("NumberPerQuantityUnit","@{[system(q(touch DIR/made))]}")',
    "setOption('SpeciesLabel',`touch DIR/made`)",
    'setOption("NumberPerQuantityUnit",6e23);system("touch DIR/made");print(1)',
    'system("touch DIR/made")',
    'readFile({file=>"DIR/secret.bngl"})',
    'readFile({file=>"DIR/secret.bngl",skip_actions=>0})',
    'generate_network({overwrite=>1,prefix=>"DIR/made"})',
    'generate_network({max_agg=>do{system("touch DIR/made");2}})',
    "generate_network({max_stoich=>{A=>`touch DIR/made`}})",
    "generate_network({max_iter=>2}),system('touch DIR/made')",
    "generate_network({max_agg=>2,system('touch DIR/made')=>3})",
    'setParameter("k",do{system("touch DIR/made");2})',
    "setParameter('k','2'.system('touch DIR/made'))",
    'setConcentration("A(b)",`touch DIR/made`)',
    "setConcentration('A(b)','1');system('touch DIR/made');('1')",
    "saveParameters(do{open(F,'>DIR/made');2})",
    'writeXML({prefix=>"DIR/made"})',
    'writeFile({prefix=>"DIR/made",format=>"bngl"})',
    'version("2.0.0");system("touch DIR/made");print(1)',
    'simulate({method=>do{system("touch DIR/made");"ssa"}})',
    "quit(system('touch DIR/made'))",
    "k tfun('DIR/secret.bngl')",
    'g() = TFUN(O,"DIR/secret.bngl")',
    'A(b) -> 0 FunctionProduct("f()","system(q(touch DIR/made))")',
    'Molecules P A(b)==1;system("touch DIR/made")',
    "Species P A(b)>0||system('touch DIR/made')",
    'parameter z do{system("touch DIR/made");2}',
    "k 2*(`touch DIR/made`)",
    "k $$x{system('touch DIR/made')}",
]
# What users write, so that some files are taken.
HONEST = [
    "generate_network({overwrite=>1,max_agg=>2})",
    'setParameter("k",2)',
    'setOption("NumberPerQuantityUnit",6.022e23)',
    "version('2.0.0')",
    "# a comment",
    "parameter j 3*k",
    "setConcentration('A(b)',3)",
    "",
]
ODD = [
    "\x0c",
    "\x0b",
    "\0",
    "\x85",
    "\u2028",
    "\u00a0",
    "\r",
    "\x1a",
    "\ufeff",
    "'",
    '"',
    "`",
    "%",
    ";",
    "\\",
    "\x1b",
    "$",
]
GOES_ON = ["\\\n", "\\ \n", "\\\t\n", "\\# x\n", "\\ #\\\n", "\\\r\n", "\\\n\\\n", "#\\\n", "\\\\\n", "\\\x0c\n"]
ENCODINGS = ["utf-8-sig", "latin-1", "utf-16", "utf-16-le"]
# A text that Antimony reads, and what may stand between the word import and its file.
ANTIMONY = ["model *main()", " A -> B; k*A", " k = 1", " A = 10; B = 0", ' A is "a name"', "end"]
WORDS = ["import", "import", "import", "Import", "IMPORT", "imp\\\nort", "im/**/port", "i\u0307mport", "\uff49mport"]
BETWEEN = [
    " ",
    "",
    "\t",
    "/* x */",
    "/**/",
    "/* \n */",
    "\\\n",
    " \\\n ",
    "\\ ",
    "\\\r\n",
    "\n",
    "//\n",
    "#\\\n",
    "\x0c",
    "/*/*/",
]
QUOTED = [
    '"DIR/secret.ant"',
    '"secret.ant"',
    "```DIR/secret.ant```",
    "'DIR/secret.ant'",
    '"DIR/secret.ant',
    "`secret.ant`",
]
BEFORE = ["", "", "", "1", "2e3", "1.", "-o", "--", ";", "k = 3 ", "/*/", "*/", "# x\r", "// x\\\n"]
BEFORE += [
    '"a\\"',
    '"a\\\\"',
    '"a" ',
    '"',
    "```",
    "````",
    "/* ",
    "\\",
    "\0",
    "\ufeff",
    "\u2028",
    "\x85",
    "...",
    "@",
    "sbo:",
    "A.",
    "'",
    "model ",
    "$",
]
CLOSING = ["", "", "", ' "', "```", " */", "\n*/", ' ";"', ' # "', "\\"]


class Canaries(Inputs):
    """Hostile files number 0, 1, ... of a seed: BNGL where the number is even, else Antimony."""

    def file(self, folder):
        """Suffix and bytes; folder : where the canaries are."""
        text = self.antimony() if self.number % 2 else self.bngl()
        if self.chance(0.1):
            text = text.replace("\n", self.one(["\r\n", "\r", "\n\r"]))
        data = text.replace("DIR", str(folder)).encode(self.one(ENCODINGS) if self.chance(0.04) else "utf-8", "replace")
        return (".ant" if self.number % 2 else ".bngl"), data

    def bngl(self):
        """A model with some lines that end its blocks, say Perl, and begin them again."""
        lines = MODEL.split("\n")
        for _ in range(int(self.rng.integers(1, 3))):
            place = int(self.rng.integers(len(lines) + 1))
            block = next((line[6:] for line in reversed(lines[:place]) if line.startswith("begin ")), "")
            said = self.one(HONEST) if self.chance(0.55) else self.one(PERL)
            match int(self.rng.integers(6)):
                case 0:
                    new = [self.dressed(f"end {block}"), self.dressed(said), self.dressed(f"begin {block}")]
                case 1:  # in the same clothes, which either show through or do not
                    where, joint = self.one([3, 4, 5, 6]), self.one(GOES_ON) + self.one(["", "", " "])
                    new = [f"end {block}", said, f"begin {block}"]
                    new[::2] = [(line[:where] + joint + line[where:]) for line in new[::2]]
                case 2:
                    new = [self.dressed(self.one(["begin actions", "begin  Actions", "begin protocol", "end model"]))]
                    new += [self.dressed(said), self.one(["end actions", "end protocol", "begin model"])]
                case 3:
                    new = (
                        [lines.pop(place - 1) + self.one([*ODD, " ", ";", "#", "#\\\n", "\\\n"]) + said]
                        if place
                        else [said]
                    )
                    place = max(place - 1, 0)
                case 4:
                    place, new = self.one([0, len(lines)]), [self.dressed(said)]
                case _:
                    new = [self.dressed(said)]
            lines[place:place] = new
        return "\n".join(lines) + self.one(["", "\n", "\\"])

    def dressed(self, line):
        """A line in other clothes: on several lines, in other case, with blanks, comments, labels, odd characters."""
        for _ in range(max(int(self.rng.integers(-1, 3)), 0)):
            place = int(self.rng.integers(len(line) + 1))
            match int(self.rng.integers(6)):
                case 0 | 1:
                    line = line[:place] + self.one(GOES_ON) + line[place:]
                case 2:
                    line = line[:place] + self.one(ODD) + line[place:]
                case 3:
                    line = self.one(["1 ", "lab: ", "0 ", "\t ", "% ", "0\n", "end ", "x=", "-- "]) + line
                case 4:
                    line += self.one([" # x", "# \\", ";", " ;;", "\t", " \\", "; # \\\n", "#\r"])
                case _:
                    line = self.one([line.upper(), line.title(), line.replace(" ", "  "), line.replace(" ", "\t")])
        return line

    def antimony(self):
        """A model with an import somewhere, hidden."""
        lines = list(ANTIMONY)
        place = self.one([0, 0, len(lines), int(self.rng.integers(len(lines) + 1))])
        between = "".join(self.one(BETWEEN) for _ in range(self.one([1, 1, 2])))
        hidden = self.usual(WORDS[:3], WORDS, 0.3) + between + self.usual(QUOTED[:3], QUOTED, 0.3)
        if self.chance(0.25):
            hidden = self.one(["important = 3", "# import", 'B is "import"', "Import: A -> B; k", "k2 = 3 \\\n + k"])
        hidden = self.usual([""], BEFORE, 0.5) + hidden + self.usual([""], CLOSING, 0.4)
        if place and self.chance(0.4):
            lines[place - 1] += self.one(["", " ", "; ", "\\\n", "/*", "*/"]) + hidden
        else:
            lines.insert(place, hidden)
        if self.chance(0.3):
            lines.insert(-1, " S: secret()")
        return "\n".join(lines)


def secrets(folder):
    """Put the files into a folder that nothing may read or change."""
    (folder / "kept").write_text("", encoding="utf-8")
    (folder / "secret.bngl").write_text(f"begin parameters\n{SECRET} 7\nend parameters\n", encoding="utf-8")
    (folder / "secret.ant").write_text(f"model secret()\n {SECRET} = 7\nend\n", encoding="utf-8")


def before(path, text):
    """What BioNetGen and Antimony got before their texts were written anew: past a filter of lines. The control."""
    if path.suffix == ".ant":
        if re.search(r'\bimport\s*"', text):
            raise ValueError
        return text
    kept, inside = [], ""
    for line in text.splitlines():
        border = re.fullmatch(r"\s*(begin|end)\s+(\w+(?:\s+\w+)*)\s*(?:#.*)?", line)
        name = " ".join(border[2].split()) if border else ""
        if name == "model":
            continue
        if border:
            if f"{border[1]} {name}" != (f"end {inside}" if inside else f"begin {name}"):
                raise ValueError
            inside = "" if inside else name
        if (border or inside) and "actions" not in (name, inside):
            if "tfun" in line.lower():
                raise ValueError
            kept.append(line)
    ours = "generate_network({overwrite=>1,prefix=>'model'})"
    return {"model.bngl": "", "generate.bngl": "\n".join(("begin model", *kept, "end model", ours, ""))}


def now(path, text):
    """What they get now."""
    from kinetics.formats.antimony import plain_text
    from kinetics.formats.bngl import bngl_files

    return plain_text(path, text) if path.suffix == ".ant" else bngl_files(path, text)[0]


def judged(path, data, door):
    """Outcome, what of it would touch a file, and the text that gets through a door, which is `now` or `before`."""
    from kinetics.support.limits import text_in

    path.write_bytes(data)
    try:
        given = door(path, text_in(path))
    except ValueError:
        return "refused", [], None
    except Exception as error:  # noqa: BLE001 - no refusal
        return type(error).__name__, [str(error)], None
    found = [each for each in (False, True) if imports(given, each)] if path.suffix == ".ant" else dangers(given)
    return ("through" if found else "harmless"), found, given


def campaign(folder, seed, first, last, door=now):
    """Suffix and outcome -> how many; number and reason of those that get through; and what the programs would get.

    folder : with the canaries, which the files name
    """
    counts, failures, given = {}, [], {}
    for number in range(first, last):
        suffix, data = Canaries(seed, number).file(folder)
        outcome, found, text = judged(Path(folder, f"input{suffix}"), data, door)
        counts[suffix, outcome] = counts.get((suffix, outcome), 0) + 1
        if text is not None:
            given[number] = text
        if found:
            failures.append((number, suffix, f"{outcome}: {found[0]!r}"[:300]))
    return counts, failures, given
