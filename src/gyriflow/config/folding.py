"""Settings of the folding simulation."""

from typing import Annotated, Literal

from pydantic import Field

from .base import Settings, setting

FieldName = Literal["displacement", "distance", "cortex_weight", "growth", "shear_modulus", "normal", "zones"]
Fraction = Annotated[float, Field(gt=0, le=2)]


class ContactSettings(Settings):
    """The two hemispheres' contact at the fissure."""

    kind: Literal["planes", "none"] = setting(
        "planes", "", "`planes`: neither hemisphere passes the fissure's plane; `none`: no contact."
    )
    penalty_pa_per_m: float = setting(5.0e5, "Pa/m", "Pressure per depth of penetration.", gt=0, le=1e9)
    gap_mm: float = setting(2.5, "mm", "Width of the fissure; each contact plane is a quarter of it off.", gt=0, le=20)


class NoGrowthSettings(Settings):
    """The ellipsoid inside which nothing grows; pial facets in it are clamped. All as fractions of the extents."""

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
    thickness_mm: float = setting(1.5, "mm", "Cortical thickness H.", gt=0, le=10)
    shear_modulus_cortex_pa: float = setting(1500.0, "Pa", "Shear modulus of the cortex.", gt=0, le=1e7)
    shear_modulus_core_pa: float = setting(300.0, "Pa", "Shear modulus of what lies under the cortex.", gt=0, le=1e7)
    poisson_ratio: float = setting(0.45, "", "Poisson's ratio ν.", ge=0, lt=0.5)
    growth_rate_per_s: float = setting(2.0e-7, "1/s", "Tangential growth rate of the cortex.", ge=-1e-5, le=1e-5)
    radial_growth_rate_per_s: float = setting(
        0.0, "1/s", "Growth rate along the cortical normal, under the cortex.", ge=-1e-5, le=1e-5
    )
    allow_negative_growth: bool = setting(False, "", "Whether the growth rates may be negative (atrophy).")
    contact: ContactSettings = setting(ContactSettings(), "", "The hemispheres' contact.")
    no_growth: NoGrowthSettings = setting(NoGrowthSettings(), "", "Where nothing grows.")
    output_every_gw: float = setting(
        1.0, "GW", "Spacing of the output weeks; the start and the end are always among them.", gt=0, le=10
    )
    fields: tuple[FieldName, ...] = setting(
        ("displacement", "cortex_weight", "growth"), "", "Fields written for ParaView at each output week."
    )
    solver: SolverSettings = setting(SolverSettings(), "", "The solvers.")
    ranks: int = setting(2, "", "MPI ranks of one simulation.", ge=1, le=4096)


def output_weeks(start_week: float, end_week: float, every_gw: float) -> list[float]:
    """Returns the output weeks of a run: the start, then every `every_gw` weeks, and the end."""
    steps = int((end_week - start_week) / every_gw + 1e-9)
    weeks = [round(start_week + n * every_gw, 6) for n in range(steps + 1)]
    return weeks if end_week - weeks[-1] < 1e-6 else [*weeks, end_week]
