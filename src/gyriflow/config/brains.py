"""The brains of a study: what each is, and from which kind of data its pial surface comes."""

from typing import Annotated, Literal

from pydantic import Field

from .base import Settings, setting

SOURCES = ("labels", "segmentation", "hemispheres", "hemisphere", "pial", "phantom", "shape")
"""The keys of a brain of which exactly one is given."""

KINDS = {
    "labels": "volume",
    "segmentation": "volume",
    "phantom": "volume",
    "hemispheres": "surface",
    "hemisphere": "surface",
    "pial": "surface",
    "shape": "surface",
}
"""The kind of data behind each source: a label volume, or surfaces as they are given."""

SIDES = ("left", "right")

SINGLE_FILES = ("labels", "image", "pial", "white")
"""The keys of a brain that hold one file each."""

ShapeKind = Literal["sphere", "ellipsoid", "half-ellipsoid", "slab"]

SHAPE_SIZES = {
    "sphere": "radius_mm",
    "ellipsoid": "semi_axes_mm",
    "half-ellipsoid": "semi_axes_mm",
    "slab": "extent_mm",
}
"""The key that holds the size of each kind of shape."""

Length = Annotated[float, Field(ge=5, le=150)]


class PhantomSettings(Settings):
    """A synthetic brain, made for the brain's week."""

    voxel_mm: float = setting(0.8, "mm", "Edge of the isotropic voxels.", ge=0.3, le=2.0)
    seed: int = setting(0, "", "Seed of the folds' random pattern.", ge=0)
    cortex_mm: float = setting(2.0, "mm", "Thickness of the cortex layer.", ge=0.8, le=4.0)


class ShapeSettings(Settings):
    """A simple geometry in the place of a brain, for teaching and verification, centred on x = 0 and y = 0."""

    kind: ShapeKind = setting(
        ..., "",
        "`sphere`, `ellipsoid` (both centred on z = 0), `half-ellipsoid` (a dome on a flat base at z = 0) or `slab` "
        "(a box upwards from z = 0).",
    )  # fmt: skip
    radius_mm: float = setting(23.0, "mm", "Radius of a sphere.", ge=5, le=150)
    semi_axes_mm: tuple[Length, Length, Length] = setting(
        (21.0, 28.0, 22.0), "mm",
        "Semi-axes along X, Y, Z of an ellipsoid or half-ellipsoid, each 5 to 150; the longest is at most twice the "
        "shortest.",
    )  # fmt: skip
    extent_mm: tuple[Length, Length, Length] = setting(
        (40.0, 40.0, 12.0), "mm", "Extents of a slab along X, Y, Z, each 5 to 150."
    )
    noise_mm: float = setting(
        0.05, "mm",
        "Root mean square height of smooth bumps that folding starts from, at most a fiftieth of the smallest size; "
        "flat bases and a slab's sides stay flat.",
        ge=0, le=0.5,
    )  # fmt: skip
    seed: int = setting(0, "", "Seed of the bumps' random pattern.", ge=0)

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """The three semi-axes, or the three extents of a slab."""
        size = getattr(self, SHAPE_SIZES[self.kind])
        return (size, size, size) if self.kind == "sphere" else size


class SegmentationSettings(Settings):
    """Your own program that makes a label volume from the brain's `image`; gyriflow itself does not segment."""

    command: str = setting(
        ..., "",
        "Shell command that reads the file {image} and writes the NIfTI file {labels}, of the same grid, with labels "
        "of the brain's `scheme`.",
    )  # fmt: skip
    container: str | None = setting(
        None, "",
        "Image in which the command runs, with Apptainer, Singularity, Docker or Podman, whichever is there: "
        "`docker://NAME` or a .sif file.",
    )  # fmt: skip


class WhiteFiles(Settings):
    """The white surfaces of one brain's hemispheres: the inner borders of the cortex."""

    left: str = setting(..., "", "File of the left hemisphere.")
    right: str = setting(..., "", "File of the right hemisphere.")


class HemisphereFiles(Settings):
    """The pial surfaces of one brain's hemispheres."""

    left: str = setting(..., "", "GIFTI, VTK, STL, PLY or FreeSurfer file of the left hemisphere.")
    right: str = setting(..., "", "GIFTI, VTK, STL, PLY or FreeSurfer file of the right hemisphere.")
    white: WhiteFiles | None = setting(
        None, "", "White surfaces in the same coordinates; the distance to them is the cortical thickness."
    )


class HemisphereFile(Settings):
    """The only hemisphere of a brain, as after hemispherectomy."""

    file: str = setting(..., "", "Its pial surface, or a volume with its tissue labels (NIfTI, MGH; needs `scheme`).")
    side: Literal["left", "right"] = setting(..., "", "Which one it is.")
    white: str | None = setting(None, "", "Its white surface, in the same coordinates; for the cortical thickness.")


class Brain(Settings):
    """One brain. Exactly one of `labels`, `segmentation`, `hemispheres`, `hemisphere`, `pial`, `phantom`, `shape` is
    its source.

    Paths are relative to the configuration file or, if no such file is there, to the working directory.
    """

    id: str = setting(
        ..., "", "Name in result paths and tables: letters, digits, - _ .", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
    )
    week: float = setting(..., "GW", "Gestational age.", ge=15, le=45)
    labels: str | None = setting(None, "", "Tissue label volume (NIfTI).")
    image: str | None = setting(
        None, "", "T2-weighted volume (NIfTI): what `segmentation` works on; with `labels`, for a figure only."
    )
    segmentation: SegmentationSettings | None = setting(
        None, "", "A program of yours that makes the labels from `image`."
    )
    scheme: str | None = setting(
        None, "",
        "What the labels mean: `spina-bifida-atlas`, `dhcp-19`, `multi-bounti-43`, `feta-7`, `drawem-9`, `freesurfer`, "
        "`crl`, `binary`, or a name of `schemes`. Needed with `labels` and `segmentation`.",
    )  # fmt: skip
    affine_from: Literal["auto", "sform", "qform"] = setting(
        "auto", "", "Which NIfTI affine of `labels` and `image` is used; `auto` refuses two that disagree."
    )
    hemispheres: HemisphereFiles | None = setting(None, "", "Surface files of the two hemispheres.")
    hemisphere: HemisphereFile | None = setting(None, "", "The only hemisphere that there is.")
    pial: str | None = setting(None, "", "Surface file of the whole brain, closed.")
    white: str | None = setting(None, "", "White surface beside `pial`, in the same coordinates.")
    coordinates: Literal["auto", "ras", "lps"] = setting(
        "auto", "",
        "Axes of the coordinates in `hemispheres`, `hemisphere` or `pial` files. `auto` finds the pose, whatever rigid "
        "motion the files went through.",
    )  # fmt: skip
    phantom: PhantomSettings | None = setting(None, "", "A synthetic brain; `{}` takes all defaults.")
    shape: ShapeSettings | None = setting(None, "", "A simple geometry in the place of a brain.")

    @property
    def source(self) -> str:
        """The one key that says where the surface comes from."""
        return next(name for name in SOURCES if getattr(self, name) is not None)

    @property
    def synthetic(self) -> bool:
        """Whether the workflow makes the brain itself."""
        return self.source in ("phantom", "shape")

    @property
    def files(self) -> list[str]:
        """The files that the surface is made from, the left hemisphere's first."""
        sides = [] if self.hemispheres is None else [self.hemispheres.left, self.hemispheres.right]
        one = None if self.hemisphere is None else self.hemisphere.file
        return [path for path in (self.labels, self.pial, *sides, one) if path is not None]

    @property
    def white_files(self) -> dict[str, str]:
        """The white surfaces by the side that they are of: left, right, whole."""
        pair = self.hemispheres.white if self.hemispheres else None
        one = {self.hemisphere.side: self.hemisphere.white} if self.hemisphere else {}
        given = {"whole": self.white} | ({"left": pair.left, "right": pair.right} if pair else {}) | one
        return {side: path for side, path in given.items() if path is not None}
