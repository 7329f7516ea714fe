"""Settings of synthetic brains: phantoms and simple shapes."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from .settings import Problem, Settings, check

PHANTOM_WEEKS = (21.0, 36.0)
"""First and last gestational week of phantoms."""

Pathology = Literal[
    "agenesis", "holoprosencephaly", "wide-ventricle", "hypoplasia", "midline-shift", "hemimegalencephaly"
]
ShapeKind = Literal["sphere", "ellipsoid", "half-ellipsoid", "slab"]
SHAPE_SIZES: dict[ShapeKind, str] = {
    "sphere": "radius_mm",
    "ellipsoid": "semi_axes_mm",
    "half-ellipsoid": "semi_axes_mm",
    "slab": "extent_mm",
}
"""The key that holds the size of each kind of shape."""
MOST_UNEQUAL_AXES = 2.0
"""Longest over shortest semi-axis of a shape: beyond this the ends are too sharp for even triangles."""
MOST_NOISE = 0.02
"""Largest height of the bumps relative to the smallest size of a shape."""

Length = Annotated[float, Field(ge=5, le=150)]


class PhantomSettings(Settings):
    """A synthetic brain of the brain's week."""

    voxel_mm: float = Field(0.8, ge=0.3, le=2.0)
    """Edge of the isotropic voxels. [mm]"""
    seed: int = Field(0, ge=0)
    """Seed of the folds' random pattern."""
    cortex_mm: float = Field(2.0, ge=0.8, le=4.0)
    """Thickness of the cortex. [mm]"""
    pathology: Pathology | None = None
    """`agenesis` of the corpus callosum, `holoprosencephaly`, `midline-shift` to the right by 8 mm, or in the
    right hemisphere `wide-ventricle`, `hypoplasia`, `hemimegalencephaly`."""

    @property
    def scheme(self) -> str:
        """The scheme of its labels: that of the example atlas, or where a hemisphere is known by them alone, BOUNTI."""
        return "dhcp-19" if self.pathology == "hypoplasia" else "spina-bifida-atlas"


class ShapeSettings(Settings):
    """A simple geometry in place of a brain, for teaching and verification, centred on x = 0 and y = 0."""

    kind: ShapeKind
    """`sphere` and `ellipsoid` are centred on z = 0; `half-ellipsoid` (a dome) and `slab` (a box) stand on z =
    0."""
    radius_mm: float = Field(23.0, ge=5, le=150)
    """Radius of a sphere. [mm]"""
    semi_axes_mm: tuple[Length, Length, Length] = (21.0, 28.0, 22.0)
    """Semi-axes along X, Y, Z of an ellipsoid or half-ellipsoid; the longest is at most twice the shortest.
    [mm]"""
    extent_mm: tuple[Length, Length, Length] = (40.0, 40.0, 12.0)
    """Extents of a slab along X, Y, Z. [mm]"""
    noise_mm: float = Field(0.05, ge=0, le=0.5)
    """Root mean square height of the smooth bumps that start the folding, at most a fiftieth of the smallest
    size. Flat bases and a slab's sides have none. [mm]"""
    seed: int = Field(0, ge=0)
    """Seed of the bumps' random pattern."""

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """The three semi-axes, or the three extents of a slab."""
        size = getattr(self, SHAPE_SIZES[self.kind])
        return (size, size, size) if self.kind == "sphere" else size

    @check
    def _size_and_bumps_fit_the_kind(self) -> Iterator[Problem]:
        own, longest, shortest = SHAPE_SIZES[self.kind], max(self.size_mm), min(self.size_mm)
        for key in dict.fromkeys(SHAPE_SIZES.values()):
            if self.gives(key) and key != own:
                yield Problem(f"has no meaning with kind {self.kind}, whose size is {own}", (key,))
        if own == "semi_axes_mm" and longest > MOST_UNEQUAL_AXES * shortest:
            expected = f"at most {MOST_UNEQUAL_AXES:g} times the shortest, {shortest:g}"
            yield Problem(f"found {longest:g} as the longest; it should be {expected}", (own,))
        largest = MOST_NOISE * shortest
        # the default suits the default sizes; only a given value can be wrong
        if self.gives("noise_mm") and self.noise_mm > largest:
            expected = f"at most {largest:g}, a fiftieth of the smallest size in {own}"
            yield Problem(f"found {self.noise_mm:g}; it should be {expected}", ("noise_mm",))
