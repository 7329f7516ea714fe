"""Studies: load and check a configuration, and resolve it into brains, simulations and
sweeps."""

from .resolve import resolve

__all__ = ["resolve"]
