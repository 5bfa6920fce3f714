"""Rule books drawn at random, most of them faulty; their target is something that a small tank of theirs makes."""

from dataclasses import replace

import numpy as np

from kinetics.assembly import RuleBook, Semantics, Senses, Structure
from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from kinetics.assembly.rules.rule_book import LivelockError
from tests.helpers.brute_tanks import BruteBook, BruteTank

LONE = Structure(((0, 0, 0),), (0,), ("a",))


def random_book(seed):
    """A book of two to four letters without any plan; None where it makes nothing."""
    rng = np.random.default_rng([seed, 1])
    scheme = str(rng.choice(["one", "two", "two", "two", "six"]))
    letters = ("a", "b", "c", "d")[: int(rng.integers(2, 5))]
    roll, across, touched = scheme != "one" and rng.random() < 0.4, rng.random() < 0.2, rng.random() < 0.2
    senses = Senses(faces=scheme, roll=bool(roll), across=across, touched=touched)
    draw = _Draw(rng, letters, senses)
    book = RuleBook(
        f"random {seed}",
        letters,
        "a",
        senses,
        LONE,
        semantics=Semantics(
            gate="any" if rng.random() < 0.1 else "mutual",
            conflict="first",
            update=("synchronous", "sequential")[rng.integers(2)],
            bonds="hold" if rng.random() < 0.1 else "break",
        ),
        combine=(_first(draw), *(rule for n in range(rng.integers(1, 4)) for rule in draw.combinations(n))),
        dissociate=tuple(draw.dissociation(n) for n in range(rng.integers(1, 4))),
        internal=tuple(draw.internal(n) for n in range(rng.integers(1, 3))) if rng.random() < 0.3 else (),
    )
    return _aimed(book, rng)


def _aimed(book, rng):
    """The book with a target: one of the structures of two to four cubes that four cubes can become."""
    try:
        brute = BruteBook(book)
        tank = BruteTank.of_free_cubes(brute, 4, most=100)
    except LivelockError:
        return None
    made = [brute.structures[n] for n in sorted(tank.seen) if len(brute.structures[n]) > 1]
    return replace(book, target=made[rng.integers(len(made))]) if made else None


def _first(draw):
    """Two free cubes bond, so that something happens."""
    face = draw.face()
    return Combination(
        rule="first", letter="a", face=face, partner="a", partner_face=face, neighbours=[], becomes=draw.letter()
    )


class _Draw:
    """Rules by chance."""

    def __init__(self, rng, letters, senses):
        self.rng, self.letters, self.senses = rng, letters, senses
        self.faces = {"one": ("f1",), "two": ("f1", "f2"), "six": ("f1", "f2", "f3")}[senses.faces]

    def letter(self):
        return self.letters[self.rng.integers(len(self.letters))]

    def face(self):
        return self.faces[self.rng.integers(len(self.faces))]

    def neighbours(self, most):
        """None, or the letters of so many neighbours."""
        if self.rng.random() < 0.3:
            return None
        return [self.letter() for _ in range(self.rng.integers(most + 1))]

    def combinations(self, n):
        """A rule for each of the two that bond."""
        ends = [(self.letter(), self.face()) for _ in range(2)]
        twist = self.roll()
        for own, other in (ends, ends[::-1]):
            yield Combination(
                rule=f"{n} {own}" + ("" if own == ends[0] else " too"),
                letter=own[0],
                face=own[1],
                partner=other[0],
                partner_face=other[1],
                neighbours=self.neighbours(1),
                roll=twist,
                across=self.across(),
                touched=self.touched(other[0]),
                becomes=self.letter(),
            )
            if ends[0] == ends[1]:
                return

    def roll(self):
        """None, or a twist that the cubes sense."""
        if not self.senses.roll or self.rng.random() < 0.5:
            return None
        twists = scheme_of(self.senses.faces).rolls
        return twists[self.rng.integers(len(twists))]

    def across(self):
        """None, or what stands at the opposite face."""
        if not self.senses.across or self.rng.random() < 0.5:
            return None
        return "" if self.rng.random() < 0.5 else self.letter()

    def touched(self, partner):
        """None, or all letters that are touched, the partner's among them."""
        if not self.senses.touched or self.rng.random() < 0.5:
            return None
        return [partner, *(self.letter() for _ in range(self.rng.integers(2)))]

    def dissociation(self, n):
        return Dissociation(
            rule=f"loss {n}",
            letter=None if self.rng.random() < 0.4 else self.letter(),
            neighbours=self.neighbours(1),
            lost=None if self.rng.random() < 0.6 else self.letter(),
            becomes="a" if self.rng.random() < 0.4 else self.letter(),
        )

    def internal(self, n):
        return Internal(rule=f"wave {n}", letter=self.letter(), has=self.letter(), becomes=self.letter())
