"""What a study will take: time, memory and disk, from what earlier ones took."""

from functools import cache
from pathlib import Path

from ..io.files import read_json

MEASURED = Path(__file__).with_name("measured.json")
"""Written by `benchmarks/cost.py`."""


@cache
def typical_seconds() -> dict[str, float]:
    """Returns the middle of what jobs of each rule took in the studies that were measured, in seconds of one core."""
    return {row["rule"]: row["typical_s"] for row in read_json(MEASURED)["rules"].values()}
