"""Rule books with a letter on every face instead of one a cube: the same assembly, and what it costs."""
