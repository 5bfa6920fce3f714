"""Plans: what runs are expected to show, how many are needed, and what held-out runs can tell."""
