"""Section VII's order of the two-sided pyramid, told from the places of its cubes alone."""

from collections import Counter

from kinetics.assembly.deriving.ways import joins_at, sites_of

CENTRES, PLATE, LAYER = ((0, 0, 1), (0, 0, -1)), 25, 9


def growth_steps(book, slow_waves=False):
    """Every docking of a free cube to every structure of a seeded book: (structure in the seed's lattice, new place).

    slow_waves : also dockings while internal rules are still at work, cube by cube
    Structures that a turn about the seed takes into each other come once.
    """
    free, seed = book.monomer(), book.seed()
    free_sites = sites_of(book, free)
    seen, waiting = set(), [seed]
    while waiting:
        structure = waiting.pop()
        marked = structure.with_letters((f"seed {structure.letters[0]}", *structure.letters[1:]))
        canonical = marked.canonical(book.scheme)
        if canonical in seen:
            continue
        seen.add(canonical)
        for made, _, _ in joins_at(book, structure, sites_of(book, structure), free, free_sites, not slow_waves):
            yield structure, made.positions[-1]
            waiting.append(made)
        if slow_waves:
            waiting.extend(book.steps(structure))


def out_of_order(structure, place):
    """What a cube comes too early for; None where it keeps section VII's order. The plate lies at z = 0."""
    x, y, z = place
    layers = Counter(layer for _, _, layer in structure.positions)
    if z and layers[0] < PLATE:
        return "plate"
    if abs(z) == 1 and (x, y) != (0, 0) and not all(centre in structure.places for centre in CENTRES):
        return "centres"
    if abs(z) == 2 and not layers[1] == layers[-1] == LAYER:
        return "3x3 plates"
    return None
