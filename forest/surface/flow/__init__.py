"""Particles on the surface of a tree: the grain of its bark."""
