"""The brains of a study: what each is, and from which kind of data its pial surface comes."""

from typing import Literal

from .base import Settings, setting

SOURCES = ("labels", "hemispheres", "pial", "phantom")
"""The keys of a brain of which exactly one is given."""

SIDES = ("left", "right")

Scheme = Literal["spina-bifida-atlas", "dhcp-19", "feta-7", "binary"]


class PhantomSettings(Settings):
    """A synthetic brain, made for the brain's week."""

    voxel_mm: float = setting(0.8, "mm", "Edge of the isotropic voxels.", ge=0.3, le=2.0)
    seed: int = setting(0, "", "Seed of the folds' random pattern.", ge=0)
    cortex_mm: float = setting(2.0, "mm", "Thickness of the cortex layer.", ge=0.8, le=4.0)


class HemisphereFiles(Settings):
    """The pial surfaces of one brain's hemispheres."""

    left: str = setting(..., "", "GIFTI, STL or PLY file of the left hemisphere.")
    right: str = setting(..., "", "GIFTI, STL or PLY file of the right hemisphere.")


class Brain(Settings):
    """One brain. Exactly one of `labels`, `hemispheres`, `pial` and `phantom` says where its surface comes from.

    Paths are relative to the configuration file or, if no such file is there, to the working directory.
    """

    id: str = setting(
        ..., "", "Name in result paths and tables: letters, digits, - _ .", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
    )
    week: float = setting(..., "GW", "Gestational age.", ge=15, le=45)
    labels: str | None = setting(None, "", "Tissue label volume (NIfTI).")
    scheme: Scheme | None = setting(None, "", "What the labels of the volume mean. Needed with `labels`.")
    affine_from: Literal["auto", "sform", "qform"] = setting(
        "auto", "", "Which NIfTI affine is used with `labels`; `auto` refuses two that disagree."
    )
    hemispheres: HemisphereFiles | None = setting(None, "", "Surface files of the two hemispheres.")
    pial: str | None = setting(None, "", "Surface file of the whole brain, closed.")
    coordinates: Literal["ras", "lps"] = setting("ras", "", "Axes of the coordinates in `hemispheres` or `pial` files.")
    phantom: PhantomSettings | None = setting(None, "", "A synthetic brain; `{}` takes all defaults.")

    @property
    def source(self) -> str:
        """The one key that says where the surface comes from."""
        return next(name for name in SOURCES if getattr(self, name) is not None)

    @property
    def files(self) -> list[str]:
        """The input files, the left hemisphere's first."""
        sides = [] if self.hemispheres is None else [self.hemispheres.left, self.hemispheres.right]
        return [path for path in (self.labels, self.pial, *sides) if path is not None]
