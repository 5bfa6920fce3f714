"""Small tanks in which everything is tried: every face, twist and bond, with one cube followed by a mark.

It knows nothing of exploration, symmetry orbits or the checker; it asks the rule book alone.
"""

from itertools import combinations, product

from kinetics.assembly import placements
from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.rule_book import LivelockError
from kinetics.assembly.structure import Structure

MARK = "*"


def marked(structure, cube):
    """The structure with one cube's letter marked; with none marked for None."""
    if cube is None:
        return structure
    letters = list(structure.letters)
    letters[cube] += MARK
    return structure.with_letters(letters)


def unmarked(structure):
    """The structure as the rules see it, and the number of its marked cube or None."""
    cube = next((n for n, letter in enumerate(structure.letters) if letter.endswith(MARK)), None)
    return (structure if cube is None else structure.with_letters([x.rstrip(MARK) for x in structure.letters])), cube


def bare(structure, scheme):
    """The shape: what is left without letters."""
    return structure.with_letters(("",) * len(structure)).canonical(scheme)


def shapes_within(target, scheme):
    """The shapes of all connected parts of the target, itself included."""
    found, waiting = set(), [frozenset({n}) for n in range(len(target))]
    while waiting:
        members = waiting.pop()
        if members not in found:
            found.add(members)
            waiting += [members | {n} for m in members for n in target.neighbours(m) if n not in members]
    return {bare(target.part(sorted(members)), scheme) for members in found}


class BruteBook:
    """What structures do under a book, each tried once. Structures are numbered as they come, marked ones apart.

    slow : internal rules act on one cube at a time, with joins and breaks in between
    restless : whether internal rules went on for ever somewhere
    squeezing : (structures before, structure after) of joins that put a cube between two opposite ones
    """

    def __init__(self, book, slow=False):
        self.book, self.slow, self.restless = book, slow, False
        self.structures, self.numbers, self.squeezing = [], {}, set()
        self._alone, self._together, self._wholes, self._may = {}, {}, {}, {}
        self.types, self._seen = scheme_of(book.scheme).types, scheme_of(book.scheme).reduced.tolist()
        target = book.target.canonical(book.scheme)
        images = [target]
        if book.scheme != "six":  # cubes that cannot tell left from right make mirror images in letters as well
            image = Structure(tuple((x, y, -z) for x, y, z in target.positions), target.rotations, target.letters)
            if bare(image, book.scheme) == bare(target, book.scheme):
                images.append(image.canonical(book.scheme))
        self.targets = {self.number(image) for image in images}
        self.parts = shapes_within(target, book.scheme)

    def number(self, structure):
        canonical = structure.canonical(self.book.scheme)
        if canonical not in self.numbers:
            self.numbers[canonical] = len(self.structures)
            self.structures.append(canonical)
        return self.numbers[canonical]

    def is_target(self, number):
        """Whether a structure, its mark left out, is the target."""
        return self.number(unmarked(self.structures[number])[0]) in self.targets

    def is_marked_target(self, number):
        """Whether a structure is the target, one of its cubes marked."""
        return unmarked(self.structures[number])[1] is not None and self.is_target(number)

    def is_part(self, number):
        """Whether a structure's shape lies within the target."""
        return bare(self.structures[number], self.book.scheme) in self.parts

    def forms(self, cubes, most):
        """The structures of up to so many cubes that form, and whether these are all: no more than `most` are sought.

        Every structure meets every other one and its like.
        """
        starts = [cube for cube in (self.book.monomer(), self.book.seed()) if cube is not None]
        known = dict.fromkeys(map(self.number, starts))
        for number in (waiting := list(known)):
            made = {n for parts in self.alone(number) for n in parts}
            for other in waiting[: waiting.index(number) + 1]:
                if self._size(number) + self._size(other) <= cubes:
                    made |= self.together(number, other)
            waiting += [n for n in sorted(made) if n not in known]
            known.update(dict.fromkeys(made))
            if len(known) > most:
                return set(known), False
        return set(known), True

    def _size(self, number):
        return len(self.structures[number])

    def alone(self, number):
        """What becomes of a structure by itself: tuples of numbers."""
        if number not in self._alone:
            parts = list(self._broken(self.structures[number]))
            if self.slow:
                whole, mark = unmarked(self.structures[number])
                parts += [[marked(changed, mark)] for changed in self.book.steps(whole)]
            self._alone[number] = {tuple(sorted(map(self.number, some))) for some in parts}
        return self._alone[number]

    def together(self, m, n):
        """What two structures join to: numbers."""
        key = (min(m, n), max(m, n))
        if key not in self._together:
            (a, mark_a), (b, mark_b) = (unmarked(self.structures[k]) for k in key)
            mark = mark_a if mark_b is None else len(a) + mark_b
            made = set()
            for whole, is_tight in self._all_wholes(a, b):
                made.add(self.number(marked(whole, mark)))
                if is_tight and mark is None:
                    self.squeezing.add((key, self.number(whole)))
            self._together[key] = made
        return self._together[key]

    def _all_wholes(self, a, b):
        """All ways to join two structures: a's cubes first, and whether some cube is squeezed in."""
        if (a, b) not in self._wholes:
            found = {}
            for whole in self._joined(a, b):
                found[whole] = _is_tight(whole, len(a))
            if self.book.semantics.update == "sequential":  # either may be the first to write
                for made in self._joined(b, a):
                    whole = made.reordered((*range(len(b), len(made)), *range(len(b))))
                    found[whole] = _is_tight(whole, len(a))
            self._wholes[a, b] = list(found.items())
        return self._wholes[a, b]

    def looks(self, structure):
        """How its cubes are turned, as far as faces show."""
        return tuple([self._seen[rotation] for rotation in structure.rotations])

    def _joined(self, a, b):
        tried = set()
        for (i, face), (j, towards) in product(a.open_faces(), b.open_faces()):
            if not self._may_bond(a.letters[i], self.types[face], b.letters[j], self.types[towards]):
                continue
            for placement in placements(a, i, face, b, j, towards):
                placed = b.moved(placement)
                docked = (i, j, placed.positions, self.looks(placed))
                if docked in tried:  # a turn of b that nobody sees
                    continue
                tried.add(docked)
                try:
                    whole = self.book.join(a, i, b, j, placement, settle=not self.slow)
                except LivelockError:
                    self.restless = True
                    continue
                if whole is not None:
                    yield whole

    def _may_bond(self, letter, face, partner, partner_face):
        """Whether there are rules for these letters and faces, whatever else they ask: spares most tries."""
        key = (letter, face, partner, partner_face)
        if key not in self._may:
            ends = [self._has_rule(*key), self._has_rule(partner, partner_face, letter, face)]
            self._may[key] = all(ends) if self.book.semantics.gate == "mutual" else any(ends)
        return self._may[key]

    def _has_rule(self, *reading):
        return any(
            all(
                admitted is None or value in admitted
                for value, admitted in zip(reading, (r.letter, r.face, r.partner, r.partner_face), strict=True)
            )
            for r in self.book.combine
        )

    def _broken(self, one):
        whole, mark = unmarked(one)
        if self.book.semantics.bonds == "hold":
            return
        for bond in whole.bonds:
            if whole.sides(*bond) is None:
                continue
            for i, j in (bond, bond[::-1]):
                try:
                    sides = self.book.break_bond(whole, i, j, settle=not self.slow)
                except LivelockError:
                    self.restless = True
                    continue
                yield [marked(part, members.index(mark) if mark in members else None) for members, part in sides]


def _is_tight(whole, n):
    """Whether one part's cube has cubes of the other part on two opposite sides."""
    side = {place: cube < n for place, cube in whole.places.items()}
    for (x, y, z), own in side.items():
        for u, v, w in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
            if side.get((x + u, y + v, z + w), own) != own and side.get((x - u, y - v, z - w), own) != own:
                return True
    return False


class BruteTank:
    """All states of a tank and the ways between them. A state is the tuple of its structures' numbers, rising.

    brute : the BruteBook
    start : structures
    most : states; with more, `is_complete` is False and `after` holds those that came first
    """

    def __init__(self, brute, start, most=4000):
        self.brute = brute
        self.start = tuple(sorted(map(brute.number, start)))
        self.after = {}
        waiting, self.is_complete = [self.start], True
        known = set(waiting)
        for state in waiting:
            if len(self.after) == most:
                self.is_complete = False
                return
            self.after[state] = self.following(state)
            waiting += self.after[state] - known
            known |= self.after[state]

    @classmethod
    def of_free_cubes(cls, brute, cubes, follow=False, most=4000):
        """A tank of free cubes, one of them the seed where there is one; follow: mark the last free cube."""
        book = brute.book
        free, seed = book.monomer(), book.seed()
        cubes_there = [free] * cubes if seed is None else [seed, *[free] * (cubes - 1)]
        if follow:
            cubes_there[-1] = marked(cubes_there[-1], 0)
        return cls(brute, cubes_there, most)

    def following(self, state):
        found = set()
        for number in set(state):
            rest = list(state)
            rest.remove(number)
            found |= {tuple(sorted([*rest, *parts])) for parts in self.brute.alone(number)}
        for m, n in set(combinations(state, 2)):
            rest = list(state)
            rest.remove(m)
            rest.remove(n)
            found |= {tuple(sorted([*rest, made])) for made in self.brute.together(m, n)}
        return found

    @property
    def seen(self):
        """The numbers of all structures in the tank's states."""
        return {number for state in self.after for number in state}

    def leading_to(self, goals):
        """The states with a way to some of the goals."""
        sources = {state: set() for state in self.after}
        for state, following in self.after.items():
            for after in following:
                sources[after].add(state)
        reached, waiting = set(goals), list(goals)
        while waiting:
            for state in sources[waiting.pop()] - reached:
                reached.add(state)
                waiting.append(state)
        return reached

    def homeless(self):
        """Marked structures of this tank, and those of them whose marked cube can still get into a target."""
        is_carrier = {n: unmarked(self.brute.structures[n])[1] is not None for n in self.seen}
        carriers = {state: next(n for n in state if is_carrier[n]) for state in self.after}
        good = self.leading_to([state for state, number in carriers.items() if self.brute.is_target(number)])
        seen, home = set(carriers.values()), {carriers[state] for state in good}
        return ({self.brute.structures[n] for n in numbers} for numbers in (seen, home))

    def starves(self):
        """Whether some state can no longer lead to all targets that the cubes would make; and whether the start."""
        cubes = sum(len(self.brute.structures[n]) for n in self.start)
        full = cubes // min(len(self.brute.structures[n]) for n in self.brute.targets)
        if self.brute.book.seed_letter is not None:
            full = min(full, 1)
        rich = [state for state in self.after if sum(map(self.brute.is_target, state)) >= full]
        good = self.leading_to(rich)
        return len(good) < len(self.after), self.start not in good

    def has_state(self, is_wanted):
        """Whether it comes to such a state, as far as was looked."""
        return any(map(is_wanted, self.after))
