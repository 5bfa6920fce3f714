"""Verification of rule books: traps, starvation, off-target structures, growth without end."""
