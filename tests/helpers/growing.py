"""Random growth by a book alone: a second opinion on closure, which knows no exploration and no network."""

from kinetics.assembly import placements


def grown(book, n_cubes, attempts, rng):
    """Canonical structures seen while random faces of random structures meet, and random bonds break."""
    tank = [book.monomer() for _ in range(n_cubes)]
    seen = set()
    for _ in range(attempts):
        a = tank.pop(rng.integers(len(tank)))
        if len(a) > 1 and book.semantics.bonds == "break" and rng.random() < 0.05:
            i, j = a.bonds[rng.integers(len(a.bonds))]
            pieces = [a] if a.sides(i, j) is None else [part for _, part in book.break_bond(a, i, j)]
        elif tank:
            b = tank.pop(rng.integers(len(tank)))
            (i, face), (j, other) = (s.open_faces()[rng.integers(len(s.open_faces()))] for s in (a, b))
            joined = None
            if book.allows(book.view(a, i, face), book.view(b, j, other)):
                joined = book.join(a, i, b, j, placements(a, i, face, b, j, other)[rng.integers(4)])
            pieces = [a, b] if joined is None else [joined]
        else:
            pieces = [a]
        tank += pieces
        seen.update(piece.canonical(book.scheme) for piece in pieces)
    return seen
