"""Settings of the figures and the report."""

from ..parameters.settings import Settings, setting


class EnergySettings(Settings):
    """Assumptions of the estimated energy and emissions: t × (cores × core_power_w + GB × memory_w_per_gb) × pue.

    The formula and the defaults are those of Green Algorithms (Lannelongue, Grealey & Inouye 2021,
    doi:10.1002/advs.202100707) for an unknown processor, a private machine, and no particular country.
    """

    core_power_w: float = setting(
        12.0, "W", "Power of one busy core: thermal design power of the processor / its cores.", gt=0, le=1000
    )
    memory_w_per_gb: float = setting(0.3725, "W/GB", "Power of the memory in use.", ge=0, le=100)
    pue: float = setting(
        1.0,
        "",
        "Power usage effectiveness: 1 for a machine of your own, 1.67 for an average data centre.",
        ge=1,
        le=10,
    )
    carbon_intensity_g_per_kwh: float = setting(
        475.0, "g/kWh", "Emissions of the electricity as CO₂; 475 is the world's average of 2019 (IEA).", ge=0, le=5000
    )


class ReportSettings(Settings):
    """Figures, and assumptions of the estimated energy."""

    dpi: int = setting(
        300, "dots per inch", "Resolution of the PNG figures; journals ask for 300 to 600.", ge=50, le=1200
    )
    paths: bool = setting(
        False, "", "Whether the report shows paths of files, which may hold names. It never shows headers of images."
    )
    energy: EnergySettings = setting(EnergySettings(), "", "Energy and emissions in the table of resources.")
