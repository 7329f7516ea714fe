"""Units at the border between files (mm, gestational weeks) and the solver (SI)."""

SECONDS_PER_GW = 604_800.0
"""One gestational week (GW) in seconds."""
M_PER_MM = 1e-3
MM_PER_M = 1e3
ML_PER_MM3 = 1e-3
CM2_PER_MM2 = 1e-2


def week_tag(week: float) -> str:
    """Return a gestational week as it stands in file names, for example "21.00" or
    "21.50"."""
    return f"{week:05.2f}"
