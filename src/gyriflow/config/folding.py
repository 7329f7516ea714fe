"""Settings of the folding simulation."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator

from .base import Settings, setting
from .varying import Varying, VaryingOrEstimated, VaryingSettings, require_bounds, varying

FieldName = Literal[
    "displacement",
    "distance",
    "cortex_weight",
    "growth",
    "shear_modulus",
    "bulk_modulus",
    "normal",
    "zones",
    "contact_pressure",
    "stress",
    "strain",
    "volume_ratio",
]
Memory = Annotated[
    Annotated[float, Tag("number")] | Annotated[Literal["infinite"], Tag("word")],
    Discriminator(lambda value: "word" if value == "infinite" else "number"),
]
Fraction = Annotated[float, Field(gt=0, le=2)]
VARYING = (
    "thickness_mm",
    "shear_modulus_cortex_pa",
    "shear_modulus_core_pa",
    "growth_rate_per_s",
    "radial_growth_rate_per_s",
    "core_growth_rate_per_s",
)
"""Keys of `folding` whose values may be curves and maps."""
GROWTH_RATES = VARYING[3:]


class ContactSettings(Settings):
    """Contact between folds, and between the two hemispheres."""

    kind: Literal["global", "planes", "none"] = setting(
        "global", "",
        "`global`: no part of the pial surface crosses another; `planes`: neither hemisphere passes the fissure's "
        "plane, folds run through each other (the paper); `none`: no contact.",
    )  # fmt: skip
    distance_mm: float | None = setting(
        None, "mm", "With `global`, distance at which contact begins; null: a fifth of the surface's mean edge.",
        gt=0, le=5,
    )  # fmt: skip
    stiffness_pa: float | None = setting(
        None, "Pa", "With `global`, stiffness of the barrier; null: a tenth of the cortex's largest shear modulus.",
        gt=0, le=1e9,
    )  # fmt: skip
    penalty_pa_per_m: float = setting(5.0e5, "Pa/m", "With `planes`, pressure per depth of penetration.", gt=0, le=1e9)
    gap_mm: float = setting(
        2.5, "mm",
        "Width of the fissure: the planes are a quarter of it off; between them nothing grows. With all kinds but "
        "`none`.",
        gt=0, le=20,
    )  # fmt: skip


class NoGrowthSettings(Settings):
    """The ellipsoid inside which nothing grows, and whose pial facets are clamped with `support: ellipsoid`."""

    kind: Literal["ellipsoid", "none"] = setting(
        "ellipsoid", "",
        "`ellipsoid`: nothing grows in it, nor in the bridge between the hemispheres; `none`: all tissue grows.",
    )  # fmt: skip
    shift_y: float = setting(0.05, "Y-extent", "Shift of its centre from the middle, to anterior.", ge=-1, le=1)
    shift_z: float = setting(-0.15, "Z-extent", "Shift of its centre from the middle, to superior.", ge=-1, le=1)
    semi_axes: tuple[Fraction, Fraction, Fraction] = setting(
        (0.35, 0.40, 0.50), "extents", "Semi-axes along X, Y, Z, each above 0 and at most 2."
    )


class SolverSettings(Settings):
    """The nonlinear and the linear solver."""

    newton_tolerance: float = setting(
        1e-6, "", "Newton ends where the residual has fallen to this part of that at u = 0.", gt=0, lt=1
    )
    krylov_tolerance: float = setting(1e-3, "", "Relative tolerance of the linear solver.", gt=0, lt=1)
    max_newton: int = setting(20, "", "Newton iterations before a step is halved.", ge=1, le=200)
    max_halvings: int = setting(6, "", "Halvings of the time step before the run ends.", ge=0, le=30)


class FoldingSettings(Settings):
    """The mechanical model, its parameters and its numerics; reference values of the paper."""

    end_week: float = setting(..., "GW", "Gestational age at which the simulation ends.", gt=15, le=45)
    step_s: float = setting(
        43200.0, "s", "Time step; the last one before an output is shortened where it does not fit.", gt=0, le=604800
    )
    thickness_mm: Varying = varying(1.5, "mm", "Cortical thickness H, at the start where it grows.", gt=0, le=10)
    thickness_growth_mm_per_gw: float = setting(
        0.0, "mm/GW", "Growth of the thickness, H = H₀ + β·t from the start on.", ge=-1, le=1
    )
    shear_modulus_cortex_pa: Varying = varying(1500.0, "Pa", "Shear modulus of the cortex.", gt=0, le=1e7)
    shear_modulus_core_pa: Varying = varying(300.0, "Pa", "Shear modulus of what lies under it.", gt=0, le=1e7)
    material: Literal["neo-hookean", "compressible-neo-hookean"] = setting(
        "neo-hookean", "",
        "Law of the material: `neo-hookean`, whose shape and volume store energy apart (the paper); "
        "`compressible-neo-hookean`, whose energy is not split (docs/model.md).",
    )  # fmt: skip
    poisson_ratio: float = setting(0.45, "", "Poisson's ratio ν.", ge=0, lt=0.5)
    growth_rate_per_s: VaryingOrEstimated = varying(
        2.0e-7, "1/s", "Tangential growth rate of the cortex; `estimated`: from the brains' areas.", ge=-1e-5, le=1e-5
    )
    radial_growth_rate_per_s: Varying = varying(
        0.0, "1/s", "Growth rate along the cortical normal, under the cortex.", ge=-1e-5, le=1e-5
    )
    core_growth_rate_per_s: VaryingOrEstimated = varying(
        0.0, "1/s",
        "Growth rate in all directions, under the cortex; `estimated`: from the brains' volumes.", ge=-1e-5, le=1e-5,
    )  # fmt: skip
    allow_negative_growth: bool = setting(False, "", "Whether the growth rates may be negative (atrophy).")
    stress_memory_gw: Memory = setting(
        0.0, "GW",
        "Time in which elastic stress relaxes: 0 forgets it after each step (the paper), `infinite` keeps all of it.",
    )  # fmt: skip
    support: Literal["ellipsoid", "base", "box", "free"] = setting(
        "ellipsoid", "",
        "What holds the brain: `ellipsoid` clamps pial facets in the ellipsoid of no growth, `base` the flat base, "
        "`box` too and lets the upright sides slide, `free` nothing (rigid motions are removed).",
    )  # fmt: skip
    contact: ContactSettings = setting(ContactSettings(), "", "Contact.")
    no_growth: NoGrowthSettings = setting(NoGrowthSettings(), "", "Where nothing grows.")
    output_every_gw: float = setting(
        1.0, "GW", "Spacing of the output weeks; the start and the end are always among them.", ge=0.01, le=10
    )
    fields: tuple[FieldName, ...] = setting(
        ("displacement", "cortex_weight", "growth"), "", "Fields written for ParaView at each output week."
    )
    solver: SolverSettings = setting(SolverSettings(), "", "The solvers.")
    ranks: int = setting(2, "", "MPI ranks of one simulation.", ge=1, le=4096)

    @field_validator(*VARYING)
    @classmethod
    def _hold_bounds(cls, value: Any, info: ValidationInfo) -> float | VaryingSettings | str:
        extra = cls.model_fields[str(info.field_name)].json_schema_extra
        assert isinstance(extra, dict)
        require_bounds(value, extra["bounds"])  # type: ignore[arg-type]
        return value

    @field_validator("stress_memory_gw")
    @classmethod
    def _not_negative(cls, value: float | str) -> float | str:
        if isinstance(value, float) and value < 0:
            raise ValueError("be 0 or more, or 'infinite'")
        return value


def output_weeks(start_week: float, end_week: float, every_gw: float) -> list[float]:
    """Returns the output weeks of a run: the start, then every `every_gw` weeks, and the end."""
    steps = int((end_week - start_week) / every_gw + 1e-9)
    weeks = [round(start_week + n * every_gw, 9) for n in range(steps + 1)]
    return weeks if end_week - weeks[-1] < 1e-6 else [*weeks, end_week]
