"""The brains of a study: what each is made from, and what is known of it."""

from dataclasses import dataclass
from typing import Any

from ..config.brains import Brain
from ..config.root import Config
from ..io.yaml_files import SCHEMES
from ..parameters.schemes import LabelScheme
from ..parameters.terms import Side
from .paths import MASK, POSE, THICKNESS, pial_of


@dataclass(frozen=True)
class Brains:
    """The brains of a configuration."""

    config: Config

    @property
    def ids(self) -> list[str]:
        """The ids of all brains, in order."""
        return [brain.id for brain in self.config.brains]

    @property
    def with_cortex(self) -> list[str]:
        """Brains whose labels give the cortical thickness."""
        return [
            brain.id
            for brain in self.config.brains
            if brain.has_labels and LabelScheme(**self.config.scheme(brain)).cortex
        ]

    @property
    def with_white(self) -> list[str]:
        """Brains of which white surfaces are given."""
        return [brain.id for brain in self.config.brains if brain.white_files]

    @property
    def with_white_measured(self) -> list[str]:
        """Brains whose white surfaces are measured."""
        return self.with_white if self.config.metrics.white_surfaces == "given" else self.with_thickness

    @property
    def with_thickness(self) -> list[str]:
        """Brains whose cortical thickness is measured."""
        return [*self.with_cortex, *self.with_white]

    @property
    def with_volumes(self) -> list[str]:
        """Brains whose labels can be counted."""
        return [brain.id for brain in self.config.brains if brain.has_labels]

    @property
    def with_image(self) -> list[str]:
        """Brains with an image to compare the surface with."""
        return [brain.id for brain in self.config.brains if brain.image]

    @property
    def to_pose(self) -> list[Brain]:
        """Brains of hemispheres whose pose has to be found, for the whole study at once."""
        return [brain for brain in self.config.brains if brain.source == "hemispheres" and brain.coordinates == "auto"]

    def week(self, brain: str) -> float:
        """Returns the gestational week of a brain."""
        return self.config.brain(brain).week

    def sides(self, brain: str) -> tuple[Side, ...]:
        """Returns the hemispheres that a brain has."""
        return self.config.brain(brain).sides

    @property
    def surfaces(self) -> list[str]:
        """The surfaces of all brains, and their thickness where it is measured."""
        pial = [path.format(brain=brain) for brain in self.ids for path in pial_of(*self.sides(brain)).values()]
        return pial + [path.format(brain=brain) for brain in self.with_thickness for path in THICKNESS.values()]

    def with_sides(self, *sides: Side) -> list[str]:
        """Returns the ids of the brains that have these hemispheres and no other."""
        return [brain.id for brain in self.config.brains if brain.sides == sides]

    def from_source(self, *sources: str) -> list[str]:
        """Returns the ids of the brains that come from one of some sources, such as `labels`."""
        return [brain.id for brain in self.config.brains if brain.source in sources]

    def scheme(self, brain: str) -> dict[str, Any] | None:
        """Returns the scheme of a brain's labels, None where it has none."""
        found = self.config.brain(brain)
        return self.config.scheme(found) if found.has_labels else None

    def shape(self, brain: str) -> dict[str, Any]:
        """Returns what a simple shape depends on."""
        shape = self.config.brain(brain).shape
        assert shape is not None
        return {
            **{"semi_axes_mm": list(shape.semi_axes_mm), "noise_mm": shape.noise_mm, "seed": shape.seed},
            "edge_length_mm": self.config.surface.edge_length_mm,
        }

    def known_files(self, brain: str) -> dict[str, tuple[str, str]]:
        """Returns by their paths the atlas and the SHA-256 of a brain's files that are an atlas's."""
        known = self.config.known_files
        return {path: known[path] for path in self.config.brain(brain).files if path in known}

    def label_volume(self, brain: str) -> str:
        """Returns the label volume of a brain that has one."""
        volume = self.config.brain(brain).label_volume
        assert volume is not None
        return volume

    def registered_volume(self, brain: str) -> str:
        """Returns the volume by which a brain is registered: its labels, or a mask made of its surface."""
        return self.label_volume(brain) if self.config.brain(brain).has_labels else MASK.format(brain=brain)

    def registered_scheme(self, brain: str) -> dict[str, Any]:
        """Returns the scheme of that volume."""
        return self.scheme(brain) or SCHEMES["binary"].model_dump()

    def pose(self, brain: str) -> str | list[str]:
        """Returns the file with the pose of a brain's hemispheres, none where it need not be found."""
        return POSE.format(brain=brain) if brain in [posed.id for posed in self.to_pose] else []

    def population(self, brain: str) -> str:
        """Returns what a brain is called in tables: its population, or synthetic or unknown."""
        found = self.config.brain(brain)
        return found.population or ("synthetic" if found.synthetic else "unknown")
