"""Whether there is a correct book of so many letters, of any kind: by a SAT solver, apart from compiler and checker.

The solver proposes what a cube answers to each reading; the book is followed to its first fault; and the answers that
led there are excluded together, with all renamings of the letters, until a book goes well or none is left
(lazy clause generation). Books may give one shape several letterings and let a join happen in some of its ways alone.
Bonds are mutual, both cubes read before either writes, and internal rules follow at once.
"""

from itertools import permutations, product

from pysat.solvers import Cadical153

from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.structure import Structure, placements

FREE = ("follow",), ("a",), ()  # a free cube, which stays free


class Oracle:
    """A book that makes a target and pieces of it alone, each of which can become it; `rounds` counts proposals."""

    def __init__(self, target, senses, breaks, letters, most=10**9):
        self.senses, self.scheme, self.breaks, self.most = senses, senses.faces, breaks, most
        self.names = "abcdefgh"[:letters]
        self.types = scheme_of(self.scheme).types
        self.target = self.bare(target)
        self.shapes, fresh = set(), {self.target}
        while fresh:
            self.shapes |= fresh
            fresh = {piece for shape in fresh for piece in self.smaller(shape)} - self.shapes
        self.solver, self.variables, self.known, self.rounds = Cadical153(), {}, {}, 0
        self.answers = {}  # of the solver, or what changes nothing
        self.asked = set()  # what the last book proposed was asked

    def bare(self, structure):
        return structure.with_letters(("#",) * len(structure)).canonical(self.scheme)

    def smaller(self, shape):
        """Without one cube; every connected piece comes of such steps."""
        for gone in range(len(shape)):
            try:
                yield self.bare(shape.part([cube for cube in range(len(shape)) if cube != gone]))
            except ValueError:
                continue

    def literal(self, reading, answer):
        if (reading, answer) not in self.variables:
            options = [*(("",) if reading[0][0] == "join" else ()), *self.names]
            own = [self.variables.setdefault((reading, o), len(self.variables) + 1) for o in options]
            self.solver.add_clause(own)
            for n, one in enumerate(own):
                for other in own[:n]:
                    self.solver.add_clause([-one, -other])
        return self.variables[reading, answer]

    def answer(self, reading):
        if reading == FREE:
            return "a"
        self.asked.add(reading)
        if reading not in self.answers:
            self.answers[reading] = "" if reading[0][0] == "join" else reading[1][0]
        return self.answers[reading]

    def finds_one(self):
        """Whether there is a book; None where the rounds are used up."""
        while self.rounds < self.most:
            self.rounds += 1
            if not self.solver.solve():
                return False
            model = set(self.solver.get_model() or ())
            self.answers = {reading: answer for (reading, answer), n in self.variables.items() if n in model}
            fault = self.fault()
            if fault is None:
                return True
            for renamed in permutations(self.names[1:]):
                name = dict(zip(self.names, ("a", *renamed), strict=True))
                self.solver.add_clause(
                    [
                        (1 if is_other else -1) * self.literal(_renamed(reading, name), name.get(answer, answer))
                        for reading, answer, is_other in sorted(fault)  # so that each run proposes the same
                    ]
                )
        return None

    @property
    def book(self):
        """Of the book that was found last: what cubes answer to what they read."""
        return {reading: self.answers[reading] for reading in self.asked}

    def fault(self):
        """What must not all be so: (reading, answer, whether it is any other answer); None: the book is correct."""
        made, events, order = {}, [], []
        self.asked = set()
        start = self.lettered(((0, 0, 0),), (0,), ("a",))
        made[start] = frozenset()
        order.append(start)
        everything, refused = set(), []
        for n, new in enumerate(order):
            happenings = [(old, new) for old in order[: n + 1]]
            for pair in happenings:
                reasons = made[pair[0]] | made[pair[1]]
                for readings, cubes, joined, fits in self.meetings(*pair):
                    told = [self.answer(reading) for reading in readings]
                    if "" in told:
                        refusals = [(r, "", False) for r, answer in zip(readings, told, strict=True) if not answer]
                        if fits:  # else a bond is a fault anyway
                            refused.append((self.bare(joined), min(refusals, key=lambda r: r not in everything)))
                            everything.add(refused[-1][1])
                        continue
                    if not fits:
                        return reasons | {(reading, "", True) for reading in readings}
                    used = {(reading, answer, False) for reading, answer in zip(readings, told, strict=True)}
                    letters = list(joined.letters)
                    for cube, answer in zip(cubes, told, strict=True):
                        letters[cube] = answer
                    rested = self.rest(joined, tuple(letters), used)
                    everything |= used
                    if rested is None:
                        return reasons | used
                    self.enter(rested, reasons | used, made, order)
                    events.append((pair, (rested,)))
            for i, j in new.bonds if self.breaks else ():
                sides = new.sides(i, j)
                if sides is None:
                    continue
                used, letters, after = set(), list(new.letters), []
                for own, gone in ((i, j), (j, i)):
                    near = tuple(sorted(new.letters[c] for c in new.neighbours(own) if c != gone))
                    reading = (("break",), (new.letters[own],), near, (new.letters[gone],))
                    letters[own] = self.answer(reading)
                    used.add((reading, letters[own], False))
                for side in sides:
                    part = new.with_letters(letters).part(side)
                    after.append(self.rest(part, part.letters, used))
                everything |= used
                if None in after:
                    return made[new] | used
                for part in after:
                    self.enter(part, made[new] | used, made, order)
                events.append(((new,), tuple(after)))
        home = {s for s in made if self.bare(s) == self.target}
        size = 0
        while len(home) > size:
            size = len(home)
            home |= {s for before, after in events if home.intersection(after) for s in before}
        if not home and len(self.names) == 1:  # then a shape has one lettering, so what is made is all that can be
            shapes = {self.bare(structure) for structure in made}
            return {refusal for shape, refusal in refused if shape not in shapes}
        return None if len(home) == len(made) else everything

    def enter(self, structure, reasons, made, order):
        if structure not in made:
            made[structure] = frozenset(reasons)
            order.append(structure)

    def lettered(self, *cubes):
        return Structure(*cubes).canonical(self.scheme)

    def rest(self, structure, letters, used):
        seen = []
        while letters not in seen:
            seen.append(letters)
            following = []
            for cube, own in enumerate(letters):
                reading = (("follow",), (own,), tuple(sorted(letters[n] for n in structure.neighbours(cube))))
                following.append(self.answer(reading))
                if reading != FREE:
                    used.add((reading, following[-1], False))
            letters = tuple(following)
        return structure.with_letters(letters).canonical(self.scheme) if letters == seen[-1] else None

    def meetings(self, one, two):
        """Each way once: what the two cubes read, which they are, the joined structure, whether it is a piece."""
        if (one, two) not in self.known:
            found = {}
            for (i, face), (j, other) in product(one.open_faces(), two.open_faces()):
                for placed in map(two.moved, placements(one, i, face, two, j, other)):
                    if one.places.keys() & placed.places.keys():
                        continue
                    joined = one.joined(placed)
                    readings = self.reading(one, i, placed, j), self.reading(placed, j, one, i)
                    fits = self.bare(joined) in self.shapes if len(joined) <= len(self.target) else False
                    marks = [
                        f"{letter}!" if c in (i, len(one) + j) else letter for c, letter in enumerate(joined.letters)
                    ]
                    key = joined.with_letters(marks).canonical(self.scheme) if fits else None
                    found.setdefault((tuple(sorted(readings)), key), (readings, (i, len(one) + j), joined, fits))
            self.known[one, two] = list(found.values())
        return self.known[one, two]

    def reading(self, own, i, other, j):
        """What a cube reads as it docks."""
        face, theirs = own.face_towards(i, other.positions[j]), other.face_towards(j, own.positions[i])
        behind = own.cube_at(own.faced(i, face ^ 1)) if self.senses.across else None
        touched = sorted(other.letters[n] for n in other.touching(own.positions[i])) if self.senses.touched else ()
        near = tuple(sorted(own.letters[n] for n in own.neighbours(i)))
        twist = roll(self.scheme, own.rotations[i], face, other.rotations[j]) if self.senses.roll else ""
        seen = "join", self.types[face], self.types[theirs], twist
        across = () if behind is None else (own.letters[behind],)
        return seen, (own.letters[i],), near, (other.letters[j],), across, tuple(touched)


def _renamed(reading, name):
    seen, *letters = reading
    return seen, *(tuple(sorted(name[n] for n in each)) for each in letters)
