"""Whether there is a correct book of so many letters, of any kind: by a solver of logic programs, apart from compiler
and checker (clingo; Gebser et al. 2019, doi:10.1017/S1471068418000054).

A program says what follows from the answers that cubes give to what they read: what is made, what comes to rest, and
which cubes can come home; its answer sets are the books. In an answer set nothing is made, rests or comes home but by
a finite chain of events. Books may give one shape several letterings, and let a join happen in some of its ways alone.
Bonds are mutual, both cubes read before either writes, and internal rules follow at once.
"""

from itertools import combinations, combinations_with_replacement, product

import clingo

from tests.helpers.answered_books import answered_book
from tests.helpers.lettered_pieces import LetteredPieces, with_letters

FREE = ("follow",), ("a",), ()  # a free cube stays free


class Oracle:
    """A book that makes a target, in one lettering, and pieces of it alone, and each cube of them can come home.

    most : conflicts of the solver; with more, nothing is decided
    conflicts : of the solver, so far
    book : the book that was found; None so far
    """

    def __init__(self, target, senses, breaks, letters, most=1_000_000):
        self.pieces, self.breaks = LetteredPieces(target, senses, "abcdefgh"[:letters]), breaks
        self.control, self.atoms, self.known = clingo.Control(), {}, {}
        self.book, self.conflicts = None, 0
        self.control.configuration.solve.solve_limit = str(most)
        with self.control.backend() as self.backend:
            self.follows(self.atom("is in the tank", 0, ("a",)), [])
            self.follows(self.atom("answers", FREE, "a"), [])
            self.say_what_is_finished()
            for piece, letterings in enumerate(self.pieces.letterings):
                for lettering in letterings:
                    self.say_what_follows(piece, lettering)
                    self.say_what_breaks(piece, lettering)
            for pair in combinations_with_replacement(range(len(self.pieces.shapes)), 2):
                self.say_what_joins(*pair)

    def finds_one(self):
        """Whether there is a book; None where it is not decided. That large pieces must not bond is said if need be."""
        result = self.solved()
        if result.satisfiable:
            with self.control.backend() as self.backend:
                for pair in combinations_with_replacement(range(len(self.pieces.shapes)), 2):
                    if self.size(*pair) > len(self.pieces.shapes[-1]):
                        self.say_what_must_not_join(*pair)
            result = self.solved()
        return None if result.unknown else bool(result.satisfiable)

    def solved(self):
        result = self.control.solve(on_model=self.read)
        self.conflicts += int(self.control.statistics["solving"]["solvers"]["conflicts"])
        return result

    def read(self, model):
        true = [key for key, atom in self.atoms.items() if model.is_true(atom)]
        answers = {key[1]: key[2] for key in true if key[0] == "answers"}
        target = next(self.pieces.shapes[-1].with_letters(key[1]) for key in true if key[0] == "is the target")
        self.book = answered_book(answers, self.pieces.senses, self.breaks, self.pieces.names, target)

    def atom(self, *key):
        if key not in self.atoms:
            self.atoms[key] = self.backend.add_atom()
        return self.atoms[key]

    def follows(self, head, body):
        self.backend.add_rule([head], body)

    def never(self, *body):
        self.backend.add_rule([], list(dict.fromkeys(body)))

    def one_of(self, atoms):
        self.backend.add_rule(atoms, [], True)
        self.never(*[-atom for atom in atoms])
        for pair in combinations(atoms, 2):
            self.never(*pair)

    def answer(self, reading, answer):
        """The atom of an answer, "" for no bond; a reading has one answer."""
        if reading != FREE and ("answers", reading, "a") not in self.atoms:
            options = [*(("",) if reading[0][0] == "join" else ()), *self.pieces.names]
            self.one_of([self.atom("answers", reading, option) for option in options])
        return self.atom("answers", reading, answer)  # a free cube has no other one

    def home(self, piece, letters, cube):
        return self.atom("comes home", piece, letters, self.pieces.first(piece, letters)[1][cube])

    def say_what_is_finished(self):
        whole = len(self.pieces.shapes) - 1
        self.one_of([self.atom("is the target", letters) for letters in self.pieces.letterings[whole]])
        for letters in self.pieces.letterings[whole]:
            for alike in self.pieces.finished_with(letters):
                body = [self.atom("rests", whole, letters), self.atom("is the target", alike)]
                self.follows(self.atom("is finished", letters), body)
            for cube in range(len(letters)):
                self.follows(self.home(whole, letters, cube), [self.atom("is finished", letters)])

    def say_what_follows(self, piece, letters):
        """Internal rules act until a structure rests, and from all that rests cubes come home."""
        is_there, rests = (self.atom(what, piece, letters) for what in ("is in the tank", "rests"))
        settles = self.atom("settles", piece, letters)
        readings = self.pieces.followed(piece, letters)
        self.never(is_there, -settles)
        for cube in range(len(letters)):
            self.never(rests, -self.home(piece, letters, cube))
        for answers in product(self.pieces.names, repeat=len(letters)):
            told = dict(zip(readings, answers, strict=True))
            if tuple(told[reading] for reading in readings) != answers:
                continue  # cubes that read alike answer alike
            after, cubes = self.pieces.first(piece, answers)
            body = [is_there, *(self.answer(*each) for each in told.items())]
            if answers == letters:
                self.follows(rests, body)
                self.follows(settles, [rests])
                continue
            becomes = self.atom("becomes", piece, letters, answers)
            self.follows(becomes, body)
            self.follows(settles, [becomes, self.atom("settles", piece, after)])
            self.happens(becomes, [((piece, letters, cube), (piece, after, n)) for cube, n in enumerate(cubes)])

    def say_what_breaks(self, piece, letters):
        for (i, j), readings, parts in self.pieces.breaks(piece, letters) if self.breaks else ():
            for answers in product(self.pieces.names, repeat=2):
                new = list(letters)
                new[i], new[j] = answers
                moves = []
                for part, members in parts:
                    after, cubes = self.pieces.first(part, tuple(new[cube] for cube in members))
                    moves += [((piece, letters, c), (part, after, n)) for c, n in zip(members, cubes, strict=True)]
                event = self.atom("breaks", piece, letters, i, j, answers)
                self.follows(event, [self.atom("rests", piece, letters), *map(self.answer, readings, answers)])
                self.happens(event, moves)

    def say_what_joins(self, one, two):
        meetings = self.pieces.meetings(one, two)
        fitting = [met for met in meetings if met.made is not None]
        for first, second in product(*(self.pieces.letterings[piece] for piece in (one, two))):
            if not fitting or (one == two and first > second):
                continue
            both = [self.atom("rests", one, first), self.atom("rests", two, second)]
            letters = first + second
            cubes = [(one, first, c) for c in range(len(first))] + [(two, second, c) for c in range(len(second))]
            for met, answers in product(fitting, product(self.pieces.names, repeat=2)):
                readings = [with_letters(reading, letters) for reading in met.readings]
                new = list(letters)
                for cube, answer in zip(met.docking, answers, strict=True):
                    new[cube] = answer
                after, numbers = self.pieces.first(met.made, tuple(new[met.order.index(n)] for n in range(len(new))))
                event = self.atom("joins", one, first, two, second, met, answers)
                self.follows(event, [*both, *map(self.answer, readings, answers)])
                ends = [(met.made, after, numbers[n]) for n in met.order]
                self.happens(event, zip(cubes, ends, strict=True))
        if self.size(one, two) <= len(self.pieces.shapes[-1]):
            self.say_what_must_not_join(one, two)

    def size(self, one, two):
        return len(self.pieces.shapes[one]) + len(self.pieces.shapes[two])

    def say_what_must_not_join(self, one, two):
        """Bonds that would make no piece of the target, whatever the letters of the cubes that are not read."""
        n, size = len(self.pieces.shapes[one]), self.size(one, two)
        for readings in (met.readings for met in self.pieces.meetings(one, two) if met.made is None):
            read = sorted({int(name) for _, *names in readings for each in names for name in each})
            for known in product(self.pieces.names, repeat=len(read)):
                letters = dict(zip(read, known, strict=True))
                told = [with_letters(reading, letters) for reading in readings]
                sides = [
                    self.some_rest(piece, tuple((c - low, letters[c]) for c in read if low <= c < high))
                    for piece, low, high in ((one, 0, n), (two, n, size))
                ]
                if None not in sides:
                    self.never(*sides, *(-self.answer(reading, "") for reading in told))

    def some_rest(self, piece, letters):
        """The atom for any piece at rest with these letters of some cubes; None where there is none."""
        if (piece, letters) not in self.known:
            fitting = [one for one in self.pieces.letterings[piece] if all(one[c] == letter for c, letter in letters)]
            self.known[piece, letters] = self.atom("some rest", piece, letters) if fitting else None
            for lettering in fitting:
                self.follows(self.known[piece, letters], [self.atom("rests", piece, lettering)])
        return self.known[piece, letters]

    def happens(self, event, moves):
        """What it makes is there, and a cube comes home where it comes home from what it becomes."""
        for (piece, letters, cube), (after, new, number) in moves:
            self.follows(self.atom("is in the tank", after, new), [event])
            self.follows(self.home(piece, letters, cube), [event, self.atom("comes home", after, new, number)])
