"""Settings of the growth rates."""

from .base import Settings, setting


class GrowthSettings(Settings):
    """Which brains the growth rates are estimated from."""

    brains: tuple[str, ...] | None = setting(
        None, "", "Ids of the brains whose areas and volumes count, of two weeks or more; `null`: all brains."
    )
