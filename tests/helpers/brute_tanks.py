"""Small tanks in which everything is tried: every face, twist and bond, with one cube followed by a mark.

It knows nothing of exploration, symmetry orbits or the checker; it asks the rule book alone.
"""

from itertools import combinations, product

from kinetics.assembly import placements

MARK = "*"


def marked(structure, cube):
    """The structure with one cube's letter marked."""
    letters = list(structure.letters)
    letters[cube] += MARK
    return structure.with_letters(letters)


def unmarked(structure):
    """The structure as the rules see it, and the number of its marked cube or None."""
    cube = next((n for n, letter in enumerate(structure.letters) if letter.endswith(MARK)), None)
    return structure.with_letters([letter.rstrip(MARK) for letter in structure.letters]), cube


class BruteTank:
    """All states of a tank of some cubes, one of them marked, and the way between them.

    A state is the tuple of its structures' canonical forms, sorted as text. None where there are more than `most`.
    """

    def __init__(self, book, cubes, most=4000):
        self.book, self._known = book, {}
        free = book.monomer()
        start = self.state([marked(free, 0), *[free] * (cubes - 1)])
        self.after = {}
        waiting = [start]
        while waiting:
            state = waiting.pop()
            if state in self.after:
                continue
            self.after[state] = self.following(state)
            waiting += self.after[state]
            self.is_complete = len(self.after) <= most
            if not self.is_complete:
                return
        self.start = start

    def state(self, structures):
        return tuple(sorted((s.canonical(self.book.scheme) for s in structures), key=str))

    def following(self, state):
        found = set()
        for n, one in enumerate(state):
            rest = state[:n] + state[n + 1 :]
            found |= {self.state([*rest, *parts]) for parts in self.outcomes(one)}
        for m, n in combinations(range(len(state)), 2):
            rest = state[:m] + state[m + 1 : n] + state[n + 1 :]
            found |= {self.state([*rest, *made]) for made in self.outcomes(state[m], state[n])}
        return found

    def outcomes(self, *structures):
        """What one structure breaks into, or two join to; marks are carried along."""
        if structures not in self._known:
            made = self.broken(*structures) if len(structures) == 1 else self.joined(*structures)
            self._known[structures] = [self.state(parts) for parts in made]
        return self._known[structures]

    def joined(self, *pair):
        orders = [pair, pair[::-1]] if self.book.semantics.update == "sequential" else [pair]
        for one, other in orders:
            (a, mark_a), (b, mark_b) = unmarked(one), unmarked(other)
            mark = mark_a if mark_b is None else len(a) + mark_b
            for (i, face), (j, towards) in product(a.open_faces(), b.open_faces()):
                for placement in placements(a, i, face, b, j, towards):
                    whole = self.book.join(a, i, b, j, placement)
                    if whole is not None:
                        yield [whole if mark is None else marked(whole, mark)]

    def broken(self, one):
        whole, mark = unmarked(one)
        if self.book.semantics.bonds == "hold":
            return
        for bond in whole.bonds:
            for i, j in (bond, bond[::-1]):
                if whole.sides(i, j) is not None:
                    yield [
                        marked(part, members.index(mark)) if mark in members else part
                        for members, part in self.book.break_bond(whole, i, j)
                    ]

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
        target = self.book.target.canonical(self.book.scheme)
        carriers = {state: next(s for s in state if unmarked(s)[1] is not None) for state in self.after}
        there = [state for state, one in carriers.items() if self.is_target(one, target)]
        good = self.leading_to(there)
        return set(carriers.values()), {carriers[state] for state in good}

    def is_target(self, structure, target):
        return unmarked(structure)[0].canonical(self.book.scheme) == target

    def starves(self):
        """Whether some state can no longer lead to all targets that the cubes would make; and whether the start."""
        target = self.book.target.canonical(self.book.scheme)
        cubes = sum(map(len, self.start))
        full = cubes // len(target)
        rich = [s for s in self.after if sum(self.is_target(one, target) for one in s) >= full]
        good = self.leading_to(rich)
        return len(good) < len(self.after), self.start not in good
