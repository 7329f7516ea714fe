"""Correspondence between weeks or brains: found from volumes, and what is carried along it."""
