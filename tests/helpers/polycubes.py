"""All shapes of two to four cubes, mirror images apart."""

SHAPES = {
    "I2": ((0, 0, 0), (1, 0, 0)),
    "I3": ((0, 0, 0), (1, 0, 0), (2, 0, 0)),
    "L3": ((0, 0, 0), (1, 0, 0), (0, 1, 0)),
    "I4": ((0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)),
    "L4": ((0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0)),
    "T4": ((0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0)),
    "S4": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0)),
    "O4": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)),
    "corner": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "right": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)),
    "left": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, -1)),
}


def grown_shapes(size):
    """The shapes of so many cubes, one after another by adding cubes, each once up to rotation: another way to them."""
    from kinetics.assembly.structure import Structure

    shapes = {frozenset({(0, 0, 0)})}
    steps = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    for _ in range(size - 1):
        shapes = {
            shape | {place}
            for shape in shapes
            for x, y, z in shape
            for u, v, w in steps
            if (place := (x + u, y + v, z + w)) not in shape
        }
    return {Structure(tuple(sorted(s)), (0,) * size, ("#",) * size).canonical("one") for s in shapes}
