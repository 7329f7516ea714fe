"""Studies: load and check a configuration, and resolve it into brains, simulations,
sweeps and figures."""

from .resolve import resolve

__all__ = ["resolve"]
