"""Settings of brains: the data that their pial surfaces are made from, regions given on
them, and tables of brains."""

from typing import Annotated

from pydantic import ConfigDict, Field

from ..formats import is_volume
from .base import InputFile, KeyProblem, Problems, Settings
from .schemes import Label
from .terms import MAX_NAME_LENGTH, SIDES, AffineSource, Coordinates, Side
from .varying import FileOrPair, files_of
from .weeks import Week, WeekNotation

SOURCES = ("labels", "hemispheres", "pial", "shape")
"""A brain has exactly one of these keys."""
SURFACE_SOURCES = ("hemispheres", "pial")
KEY_SOURCES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(
        ("scheme", "image", "affine_from"),
        ("labels",),
    ),
    "coordinates": SURFACE_SOURCES,
    "white": SURFACE_SOURCES,
    "side": ("labels", "pial"),
    "population": ("labels", *SURFACE_SOURCES),
}
"""Keys that can only be used with some sources."""


MAX_AXIS_RATIO = 2.0
"""Limit of longest over shortest semi-axis; the ends of longer shapes are too sharp for
even triangles."""
Length = Annotated[float, Field(ge=5, le=150)]


class ShapeSettings(Settings):
    """An ellipsoid in place of a brain, for teaching and verification, centred on the
    origin; `{}` is one of 21 GW. Folding starts from smooth bumps of 0.05 mm."""

    semi_axes_mm: tuple[Length, Length, Length] = (21.0, 28.0, 22.0)
    """Semi-axes along X, Y, Z, all the same for a sphere; the longest is at most twice
    the shortest. [mm]"""

    def problems(self) -> Problems:
        shortest, longest = min(self.semi_axes_mm), max(self.semi_axes_mm)
        if longest > MAX_AXIS_RATIO * shortest:
            text = (
                f"found {longest:g} as the longest; expected at most {MAX_AXIS_RATIO:g}"
                " times the shortest"
            )
            yield KeyProblem(text, ("semi_axes_mm",))


class HemisphereFiles(Settings):
    """The pial surfaces of both hemispheres, such as GIFTI or FreeSurfer files."""

    left: InputFile
    """File of the left hemisphere."""
    right: InputFile
    """File of the right hemisphere."""


class BrainConfig(Settings):
    """One brain, made from exactly one of `labels`, `hemispheres`, `pial` and
    `shape`."""

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=MAX_NAME_LENGTH)
    """Name in paths and tables: letters, digits, - _ ."""
    week: Week
    """Gestational age, such as `24.3` or `24+2`; rounded to two decimals. [GW]"""
    population: str | None = Field(None, min_length=1)
    """Population in figures and tables, such as `spina bifida aperta`; `null`: observed
    brain."""
    subject: str | None = Field(None, min_length=1)
    """Subject, if several brains are scans of one. Changes between scans are tabulated,
    and simulations are compared with scans of their own subject first."""
    covariates: dict[str, str] = Field({})
    """Further properties, such as `{sex: F}`: columns of `metrics_wide.csv`, whose own
    columns have other names, and of the export."""
    labels: InputFile | None = None
    """Tissue label volume, such as a NIfTI or MGZ file."""
    image: InputFile | None = None
    """T2-weighted volume (NIfTI) of the labels, shown in a figure."""
    scheme: str | None = None
    """Label scheme: the name of a file in the folder `schemes`, such as `dhcp-19`, or
    of an entry of the key `schemes`. Required with `labels`."""
    affine_from: AffineSource = "auto"
    """NIfTI affine of `labels` and `image`; `auto` refuses two that disagree."""
    hemispheres: HemisphereFiles | None = None
    """Surface files of both hemispheres."""
    pial: InputFile | None = None
    """Closed surface of the whole brain."""
    side: Side | None = None
    """The only hemisphere, after hemispherectomy or if the data has one side: `labels`
    have no cortex of the other one, or `pial` is the closed surface of this one."""
    white: FileOrPair | None = None
    """White surface in the same coordinates, for the cortical thickness: a file; with
    `hemispheres`, a list of the left and the right file."""
    coordinates: Coordinates = "auto"
    """Axes of surface files; `auto` determines any pose from the shape."""
    shape: ShapeSettings | None = None
    """A simple geometry in place of a brain."""

    @property
    def source(self) -> str:
        return next(name for name in SOURCES if self.is_set(name))

    @property
    def sides(self) -> tuple[Side, ...]:
        return SIDES if self.side is None else (self.side,)

    @property
    def files(self) -> list[str]:
        paths = [self.labels, self.pial]
        if self.hemispheres is not None:
            paths += [self.hemispheres.left, self.hemispheres.right]
        return [path for path in paths if path is not None]

    @property
    def white_files(self) -> dict[str, str]:
        files = files_of(self.white)
        return dict(
            zip(
                SIDES if len(files) == 2 else ("whole",),
                files,
                strict=False,
            )
        )

    def problems(self) -> Problems:
        sources = [key for key in SOURCES if self.is_set(key)]
        if not sources and self.image is not None:
            yield KeyProblem(
                "gyriflow does not segment images; give a label volume under labels",
                ("image",),
            )
        elif len(sources) != 1:
            text = (
                f"found {' and '.join(sources) or 'none'}; expected exactly one of"
                f" {', '.join(SOURCES)}"
            )
            yield KeyProblem(text)
        else:
            for key, kinds in KEY_SOURCES.items():
                if key in self.model_fields_set and self.source not in kinds:
                    yield KeyProblem(
                        f"is not used with {self.source}, only with"
                        f" {' or '.join(kinds)}; remove it",
                        (key,),
                    )
            has_white = self.white is not None and self.source in SURFACE_SOURCES
            has_pair = "left" in self.white_files
            if has_white and has_pair != (self.source == "hemispheres"):
                yield KeyProblem(
                    "should have one file for each pial surface", ("white",)
                )
            if self.labels is not None and self.scheme is None:
                yield KeyProblem(
                    "is missing; it defines the meaning of the labels", ("scheme",)
                )


# regions


class GivenRegions(Settings):
    """Regions of a brain, from a label volume or from labels of both hemispheres'
    surfaces.

    Left and right regions with the same name are compared. Other brains get the regions
    of the brain closest in week.
    """

    labels: FileOrPair
    """Label volume (NIfTI) in the space of the brain's `labels`, with regions along the
    cortex; or a list of the left and the right GIFTI label file (.label.gii), with a
    label for each vertex of `surface`."""
    surface: tuple[InputFile, InputFile] | None = None
    """With label files, the left and the right surface, in the coordinates of the
    brain's own files."""
    names: dict[Label, str] = Field({})
    """Region of each label, such as `{1: frontal, 2: frontal, 3: parietal}`. Labels
    with the same name are one region; labels without a name are ignored. Required with
    a volume; by default the label files' own names are used."""

    @property
    def volume(self) -> str | None:
        return self.labels if isinstance(self.labels, str) else None

    def problems(self) -> Problems:
        if self.volume is None:
            if self.surface is None:
                yield KeyProblem(
                    "is missing; the labels belong to its vertices", ("surface",)
                )
            return
        if not is_volume(self.volume):
            yield KeyProblem(
                "found one file of a surface; expected the left and the right one, or a"
                " volume",
                ("labels",),
            )
            return
        if self.surface is not None:
            yield KeyProblem("is not used with a volume; remove it", ("surface",))
        if not self.names:
            yield KeyProblem(
                "is missing; it defines the regions of the volume", ("names",)
            )

    @property
    def files(self) -> dict[str, str]:
        if self.volume is not None:
            return {"volume": self.volume}
        files = {}
        for side, labels, surface in zip(
            SIDES, self.labels, self.surface or (), strict=True
        ):
            files[f"{side}_labels"] = labels
            files[f"{side}_surface"] = surface
        return files


# tables of brains


class ParticipantsSettings(Settings):
    """A table with a brain in each row. `participants: FILE` is short for a section.

    Columns are `participant_id` (or `id`); `session_id` (or `session`, `visit`) where a
    subject has several scans; the age at the scan, `scan_age`, or else
    `gestational_age` or `week`, as `24.3`, `24+2` or `24w2d` (in days with
    `scan_age_days`); and keys of brains, inner ones with a dot (`hemispheres.left`),
    two `white` surfaces with a semicolon between. Instead of keys, `files` may name
    labels, a pial surface, or left and right surfaces with a semicolon between; with
    `side`, one of these is the only hemisphere. `n/a` is an empty value. Other columns
    are covariates. Each participant is a subject. One with a
    `sub-01/sub-01_sessions.tsv` next to the table has a brain for each session, with
    its age.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})
    short_key = ("file", str)

    file: str
    """File with tabs, semicolons or commas between columns; paths in it are relative to
    it."""
    ages: WeekNotation | None = None
    """Whether 24.3 is a `decimal` or 24 weeks and 3 `days`; needed if all decimals of a
    table could be days."""
    columns: dict[str, str] = Field({})
    """Columns to add to the table, with one value for all rows. In it `{subject}`,
    `{session}` and `{id}` are the row's, such as `sub-01`, `ses-1` and
    `sub-01_ses-1`: `{labels: '{subject}/{session}/anat/{id}_dseg.nii.gz', scheme:
    feta-7}`. A session has its `ses-`, whether the table has it or not."""
