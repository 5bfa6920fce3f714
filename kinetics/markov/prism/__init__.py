"""PRISM's language: models of Markov chains in continuous time, read as chains, and networks written as models."""
