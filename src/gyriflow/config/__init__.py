"""The configuration: models with units and bounds, and the one function that validates it."""

from .loading import load
from .root import Config

__all__ = ["Config", "load"]
