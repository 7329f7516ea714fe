"""Settings of the figures and the report."""

from .base import Settings, setting


class ReportSettings(Settings):
    """How figures are drawn."""

    dpi: int = setting(150, "dots per inch", "Resolution of the PNG figures.", ge=50, le=1200)
