"""Pictures of structures, rules, networks and counterexamples."""
