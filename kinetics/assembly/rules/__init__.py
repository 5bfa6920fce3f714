"""Rule books: what a cube reads, whether two may bond, and what comes of it."""
