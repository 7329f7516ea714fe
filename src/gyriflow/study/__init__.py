"""What a study consists of: from a configuration to its brains, runs, comparisons, and where results lie."""

from .plan import Plan
from .resolve import resolve

__all__ = ["Plan", "resolve"]
