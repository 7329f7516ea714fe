"""The brains of a study, and the data that their pial surfaces are made from."""

from collections.abc import Iterator

from ..parameters.files import InputFile
from ..parameters.schemes import SCHEMES
from ..parameters.settings import NotValidError, Problem, Settings, check, setting
from ..parameters.synthetic import PHANTOM_WEEKS, PhantomSettings, ShapeSettings
from ..parameters.terms import LONGEST_NAME, SIDES, AffineSource, Coordinates, Side
from ..parameters.varying import Week

SOURCES = ("labels", "segmentation", "hemispheres", "hemisphere", "pial", "phantom", "shape")
"""The keys of which a brain has exactly one."""

KINDS = {
    "labels": "volume",
    "segmentation": "volume",
    "phantom": "volume",
    "hemispheres": "surface",
    "hemisphere": "surface",
    "pial": "surface",
    "shape": "surface",
}
"""The kind of data behind each source: a label volume, or surfaces as they are given; a `hemisphere` may be either."""
VOLUME_SUFFIXES = (".nii", ".nii.gz", ".mgz", ".mgh")
"""How the names of volumes end."""

VOLUMES = ("labels", "segmentation")
"""Sources that give a label volume."""
MEANINGS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("scheme", "image", "affine_from"), (*VOLUMES, "hemisphere")),
    "coordinates": ("hemispheres", "hemisphere", "pial"),
    "white": ("pial",),
    "population": tuple(source for source in SOURCES if source not in ("phantom", "shape")),
}
"""Keys that make sense only with some sources."""
PLACEHOLDERS = ("{image}", "{labels}")
"""Placeholders for the two files in a segmentation command."""


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

    @check
    def _names_its_files(self) -> Iterator[Problem]:
        missing = [place for place in PLACEHOLDERS if place not in self.command]
        if missing:
            text = f"lacks {' and '.join(missing)}, the placeholders for the files it reads and writes"
            yield Problem(text, ("command",))


class WhiteFiles(Settings):
    """The white surfaces of one brain's hemispheres: the inner borders of the cortex."""

    left: InputFile = setting(..., "", "File of the left hemisphere.")
    right: InputFile = setting(..., "", "File of the right hemisphere.")


class HemisphereFiles(Settings):
    """The pial surfaces of one brain's hemispheres."""

    left: InputFile = setting(..., "", "GIFTI, VTK, STL, PLY or FreeSurfer file of the left hemisphere.")
    right: InputFile = setting(..., "", "GIFTI, VTK, STL, PLY or FreeSurfer file of the right hemisphere.")
    white: WhiteFiles | None = setting(
        None, "", "White surfaces in the same coordinates; the distance to them is the cortical thickness."
    )


class OneHemisphere(Settings):
    """The only hemisphere of a brain, after hemispherectomy or where the data has one side only."""

    file: InputFile = setting(
        ..., "",
        "Its closed pial surface (GIFTI, VTK, STL, PLY or FreeSurfer), or with the brain's `scheme` a label volume "
        "that holds nothing of the other hemisphere's cortex.",
    )  # fmt: skip
    side: Side = setting(..., "", "`left` or `right`.")
    white: InputFile | None = setting(
        None, "", "With a pial surface, the white surface in the same coordinates, for the cortical thickness."
    )


class Brain(Settings):
    """One brain. Exactly one of `labels`, `segmentation`, `hemispheres`, `hemisphere`, `pial`, `phantom`, `shape` is
    its source.

    Paths are relative to the configuration file or, if no such file is there, to the working directory.
    """

    id: str = setting(
        ...,
        "",
        "Name in result paths and tables: letters, digits, - _ .",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$",
        max_length=LONGEST_NAME,
    )
    week: Week = setting(..., "GW", "Gestational age.")
    population: str | None = setting(
        None, "",
        "Name of the population in figures and tables, such as `spina bifida aperta, unoperated`; `null`: real brain.",
        min_length=1,
    )  # fmt: skip
    subject: str | None = setting(
        None, "",
        "Subject that was scanned, where several brains are scans of one: change between them is then tabled, and "
        "simulations from one are compared with the others first.",
        min_length=1,
    )  # fmt: skip
    labels: InputFile | None = setting(None, "", "Tissue label volume (NIfTI or MGZ).")
    image: InputFile | None = setting(
        None, "", "T2-weighted volume (NIfTI): the input of `segmentation`; with `labels`, for a figure only."
    )
    segmentation: SegmentationSettings | None = setting(
        None, "", "Your own program that makes the labels from `image`."
    )
    scheme: str | None = setting(
        None, "",
        f"Meaning of the labels: {', '.join(f'`{name}`' for name in SCHEMES)}, or a name of `schemes`. Needed with "
        "`labels` and `segmentation`.",
    )  # fmt: skip
    affine_from: AffineSource = setting(
        "auto", "", "Which NIfTI affine of `labels` and `image` is used; `auto` refuses two that disagree."
    )
    hemispheres: HemisphereFiles | None = setting(None, "", "Surface files of the two hemispheres.")
    hemisphere: OneHemisphere | None = setting(None, "", "The only hemisphere, as a surface or as labels.")
    pial: InputFile | None = setting(None, "", "Surface file of the whole brain, closed.")
    white: InputFile | None = setting(
        None, "", "White surface of `pial` in the same coordinates; the distance to it is the cortical thickness."
    )
    coordinates: Coordinates = setting(
        "auto", "",
        "Axes of the coordinates in surface files. `auto` finds the pose, whatever it is.",
    )  # fmt: skip
    phantom: PhantomSettings | None = setting(None, "", "A synthetic brain; `{}` takes all defaults.")
    shape: ShapeSettings | None = setting(None, "", "A simple geometry in place of a brain.")

    @property
    def source(self) -> str:
        """The key that the surface is made from."""
        for name in SOURCES:
            if self.gives(name):
                return name
        raise NotValidError("source")

    @property
    def synthetic(self) -> bool:
        """Whether the workflow makes the brain itself."""
        return self.source in ("phantom", "shape")

    @property
    def sides(self) -> tuple[Side, ...]:
        """The hemispheres that the brain has."""
        return SIDES if self.hemisphere is None else (self.hemisphere.side,)

    @property
    def kind(self) -> str:
        """The kind of data that the surface is made from, with the side of a hemisphere that is alone."""
        if self.hemisphere is None:
            return KINDS[self.source]
        return f"{self.hemisphere.side} {'surface' if self.label_volume is None else 'volume'}"

    @property
    def label_volume(self) -> str | None:
        """The label volume that the user gives; None where there is none, or the workflow makes it."""
        if self.hemisphere is not None and self.scheme is not None:
            return self.hemisphere.file
        return self.labels

    @property
    def has_labels(self) -> bool:
        """Whether the surface is made from a label volume."""
        return self.label_volume is not None or self.source in ("segmentation", "phantom")

    @property
    def has_vertices(self) -> bool:
        """Whether the surface is made from surface files, whose vertices may be those of other brains too."""
        return not self.has_labels and self.source in ("hemispheres", "hemisphere", "pial")

    @property
    def files(self) -> list[str]:
        """The files that the surface is made from, the left hemisphere's first."""
        sides = [] if self.hemispheres is None else [self.hemispheres.left, self.hemispheres.right]
        one = None if self.hemisphere is None else self.hemisphere.file
        return [path for path in (self.labels, self.pial, *sides, one) if path is not None]

    @property
    def white_files(self) -> dict[str, str]:
        """The white surfaces by what they are of: left, right, whole."""
        if self.hemisphere is not None:
            return {} if self.hemisphere.white is None else {"whole": self.hemisphere.white}
        pair = self.hemispheres.white if self.hemispheres else None
        sides = {} if pair is None else {"left": pair.left, "right": pair.right}
        return sides if self.white is None else {"whole": self.white}

    @check
    def _has_one_source(self) -> Iterator[Problem]:
        given = [key for key in SOURCES if self.gives(key)]
        if not given and self.gives("image"):
            yield Problem(
                "gyriflow does not segment images; give a label volume under labels, or under segmentation your own "
                "command that makes one from the image",
                ("image",),
            )
        elif len(given) != 1:
            found = " and ".join(given) or "none"
            yield Problem(f"found {found} as its source; expected exactly one of {', '.join(SOURCES)}")
        else:
            for key, sources in MEANINGS.items():
                if key in self.model_fields_set and given[0] not in sources:
                    yield Problem(f"has no meaning with {given[0]}; only with {' or '.join(sources)}", (key,))

    @check
    def _labels_have_a_scheme(self) -> Iterator[Problem]:
        if any(self.gives(key) for key in VOLUMES) and not self.gives("scheme"):
            yield Problem("is missing; it says what the labels mean", ("scheme",))

    @check
    def _a_hemisphere_is_labels_or_surface(self) -> Iterator[Problem]:
        if self.hemisphere is None or not self.hemisphere.has("file"):
            return
        volume = self.hemisphere.file.lower().endswith(VOLUME_SUFFIXES)
        if volume and not self.gives("scheme"):
            yield Problem("is missing; it says what the labels of the hemisphere mean", ("scheme",))
        if volume and "coordinates" in self.model_fields_set:
            yield Problem("has no meaning with a label volume, whose affine says them", ("coordinates",))
        if volume and self.hemisphere.gives("white"):
            yield Problem("has no meaning with a label volume", ("hemisphere", "white"))
        for key in () if volume else ("scheme", "image", "affine_from"):
            if key in self.model_fields_set:
                yield Problem("has no meaning with a surface; only with labels", (key,))

    @check
    def _segmentation_has_an_image(self) -> Iterator[Problem]:
        if self.gives("segmentation") and not self.gives("image"):
            yield Problem("has no image to work on; give one under image", ("segmentation",))

    @check
    def _phantoms_have_weeks(self) -> Iterator[Problem]:
        first, last = PHANTOM_WEEKS
        if self.gives("phantom") and not first <= self.week <= last:
            yield Problem(f"found {self.week:g}; a phantom's should be {first:g} to {last:g}", ("week",))
