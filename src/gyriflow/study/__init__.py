"""What a study consists of: from a configuration to its brains, runs, chains, comparisons, and where results lie."""

from .study import Plan

__all__ = ["Plan"]
