"""What a study consists of: a configuration is resolved once into its brains, runs and comparisons, and their files."""

from .resolve import resolve

__all__ = ["resolve"]
