"""Random books that are right by how they are made: each cube of a branched target has a letter of its own.

Cubes know six faces and the twist, so that each letter has one place beside each other one. Whatever forms is a part of
the target, and falls apart again into free cubes unless bonds hold.
"""

import numpy as np

from kinetics.assembly import RuleBook, Semantics, Senses, Structure
from kinetics.assembly.faces import NORMALS, roll
from kinetics.assembly.rules.conditions import Combination, Dissociation

FREE = "a"


def tree_book(seed, cubes, bonds="break", seeded=False, has_gap=False):
    """A book of a random branched target, without loops; has_gap: it holds a place between two opposite cubes."""
    rng = np.random.default_rng(seed)
    places, parents = _branched(rng, cubes)
    while has_gap and gap_of(places) is None:
        places, parents = _branched(rng, cubes)
    while True:
        target = _lettered(rng, places)
        ends = [_faces(target, parent, cube) for cube, parent in parents.items()]
        if seeded or ends[0][0] != ends[0][1]:  # else two free cubes cannot tell who becomes which
            break
    combine = []
    for number, ((parent, cube), (own, other, twist)) in enumerate(zip(_edges(parents), ends, strict=True)):
        is_first = number == 0 and not seeded
        hosts = (FREE, str(parent)) if is_first else (str(parent),)
        combine += _bond(str(number), hosts, own, str(parent), (FREE, str(cube)), other, str(cube), twist)
    letters = [str(n) for n in range(cubes)]
    lone = Dissociation(rule="lone", letter=letters[1 if seeded else 0 :], neighbours=[], becomes=FREE)
    return RuleBook(
        f"tree {seed}",
        (FREE, *letters),
        FREE,
        Senses(faces="six", roll=True),
        target,
        seed_letter="0" if seeded else None,
        semantics=Semantics(bonds=bonds, conflict="first"),
        combine=tuple(combine),
        dissociate=(lone,),
    )


def pairs_book(seed):
    """A book of a random path of four cubes, made of two pairs; single cubes bond to nothing but single cubes."""
    rng = np.random.default_rng(seed)
    while True:
        places, parents = _branched(rng, 4)
        if list(parents.values()) != [0, 1, 2]:
            continue
        target = _lettered(rng, places)
        ends = [_faces(target, n, n + 1) for n in range(3)]
        if ends[0][0] != ends[0][1] and ends[2][0] != ends[2][1] and set(ends[0][:2]) != set(ends[2][:2]):
            break
    combine = []
    for n in (0, 2):
        own, other, twist = ends[n]
        combine += _bond(f"pair {n}", (FREE,), own, str(n), (FREE,), other, str(n + 1), twist)
    own, other, twist = ends[1]
    middle = _bond("whole", ("1",), own, "1", ("2",), other, "2", twist)
    combine += [rule.replace(neighbours=(x,)) for rule, x in zip(middle, "03", strict=True)]
    lone = Dissociation(rule="lone", neighbours=[], becomes=FREE)
    semantics = Semantics(conflict="first")
    senses, letters = Senses(faces="six", roll=True), (FREE, "0", "1", "2", "3")
    return RuleBook(
        f"pairs {seed}", letters, FREE, senses, target, None, semantics, combine=tuple(combine), dissociate=(lone,)
    )


def gap_of(places):
    """(an empty place between two opposite cubes, a third cube beside it), or None."""
    there = {place: n for n, place in enumerate(places)}
    for host, (x, y, z) in enumerate(places):
        for u, v, w in NORMALS:
            gap = (x + u, y + v, z + w)
            if gap in there:
                continue
            for r, s, t in NORMALS:
                opposite = [there.get((gap[0] + k * r, gap[1] + k * s, gap[2] + k * t)) for k in (1, -1)]
                if None not in opposite and host not in opposite:
                    return gap, host
    return None


def face_types(rule_face):
    """The name of a face by its number, of six."""
    return f"f{rule_face + 1}"


def _bond(name, first, face, becomes, second, other_face, other_becomes, twist):
    """The two rules by which cubes with some letters bond at two faces."""
    return [
        Combination(rule=f"{name}, first", letter=first, face=face, partner=second, partner_face=other_face,
                    roll=twist, becomes=becomes),
        Combination(rule=f"{name}, second", letter=second, face=other_face, partner=first, partner_face=face,
                    roll=twist, becomes=other_becomes),
    ]  # fmt: skip


def _edges(parents):
    return [(parent, cube) for cube, parent in parents.items()]


def _branched(rng, cubes):
    """Places, each beside one earlier place alone; cube -> the earlier one."""
    places, parents = [(0, 0, 0)], {}
    while len(places) < cubes:
        x, y, z = places[rng.integers(len(places))]
        u, v, w = NORMALS[rng.integers(6)]
        new = (x + u, y + v, z + w)
        beside = [n for n, place in enumerate(places) if sum(abs(a - b) for a, b in zip(place, new, strict=True)) == 1]
        if new not in places and len(beside) == 1:
            parents[len(places)] = beside[0]
            places.append(new)
    return tuple(places), parents


def _lettered(rng, places):
    turns = tuple(int(n) for n in rng.integers(24, size=len(places)))
    return Structure(places, turns, tuple(str(n) for n in range(len(places))))


def _faces(target, one, other):
    """The two faces of a bond, and its twist."""
    own, towards = (target.face_towards(m, target.positions[n]) for m, n in ((one, other), (other, one)))
    twist = roll("six", target.rotations[one], own, target.rotations[other])
    return face_types(own), face_types(towards), twist
