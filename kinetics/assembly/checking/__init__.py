"""What is wrong with a rule book: traps, starvation, off-target shapes, growth without end."""
