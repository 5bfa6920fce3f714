"""Rule books: what a cube senses, when two cubes may bond, and how their letters change."""
