"""Label schemes: the numbers of a tissue label volume that are cerebrum, cortex, left,
right and other tissues.

The shipped schemes are the files of the folder `schemes`, read by `io.yaml_files`.
"""

from typing import Annotated

from pydantic import Field

from ..shipped import SHIPPED
from .base import KeyProblem, Problems, Settings

SCHEME_FILES = {
    path.stem: path for path in sorted((SHIPPED / "schemes").glob("*.yaml"))
}
"""Files of the shipped schemes, by name."""
Label = Annotated[
    int,
    Field(
        ge=1,
        le=2**31 - 1,
    ),
]


class SchemeSettings(Settings):
    """Meaning of the labels of a volume; 0 is background. A brain refers to it by
    `scheme: NAME`."""

    cerebrum: tuple[Label, ...]
    """Labels that together fill the cerebrum inside the pial surface. Not all of them
    need to occur."""
    cortex: tuple[Label, ...] = ()
    """Labels of the cortex; at least one must occur. Used to open the fissure and to
    measure cortical thickness."""
    left: tuple[Label, ...] = ()
    """Labels of the left hemisphere only. With `right` they separate the
    hemispheres."""
    right: tuple[Label, ...] = ()
    """Labels of the right hemisphere only."""
    white_matter: tuple[Label, ...] = ()
    """Labels of white matter; at least one must occur."""
    ventricles: tuple[Label, ...] = ()
    """Labels of fluid, which is left out where it is not enclosed by tissue."""
    cerebellum: tuple[Label, ...] = ()
    """Labels of the cerebellum, outside the cerebrum. Used with `brainstem` to
    determine the pose."""
    brainstem: tuple[Label, ...] = ()
    """Labels of the brainstem, outside the cerebrum."""
    known: dict[Label, str] = Field({})
    """Tissue of every label that is in none of the lists, such as `{4: outer CSF}`."""

    @property
    def labels(self) -> dict[int, str]:
        # a label without a name gets the name of its list
        named = dict.fromkeys(self.cerebrum, "cerebrum")
        for tissue in (
            "white_matter",
            "ventricles",
            "cortex",
            "cerebellum",
            "brainstem",
        ):
            named |= dict.fromkeys(
                getattr(self, tissue),
                tissue.replace("_", " "),
            )
        return dict(sorted((named | self.known).items()))

    def problems(self) -> Problems:
        if not self.cerebrum:
            yield KeyProblem(
                "found no labels; it should have one or more", ("cerebrum",)
            )
        for key in (
            "cerebrum",
            "cortex",
            "left",
            "right",
            "white_matter",
            "ventricles",
        ):
            labels = getattr(self, key)
            twice = sorted({label for label in labels if labels.count(label) > 1})
            outside = sorted(set(labels) - set(self.cerebrum))
            if twice:
                yield KeyProblem(
                    f"found {_as_text(twice)} more than once",
                    (key,),
                )
            if outside:
                yield KeyProblem(
                    f"found {_as_text(outside)}; it should have labels of the cerebrum"
                    " only",
                    (key,),
                )
        if self.cortex and set(self.cerebrum) <= set(self.cortex):
            yield KeyProblem(
                "found all of the cerebrum; the tissue inside the cortex is missing",
                ("cortex",),
            )
        both = sorted(set(self.left) & set(self.right))
        if both:
            yield KeyProblem(
                f"found {_as_text(both)}, which are also in left", ("right",)
            )
        if bool(self.left) != bool(self.right):
            side = "right" if self.left else "left"
            yield KeyProblem(
                "is missing; the hemispheres are separated by both left and right",
                (side,),
            )


class LabelScheme(SchemeSettings):
    """A label scheme with its name."""

    name: str
    """Name of the scheme."""


FILLED = LabelScheme(
    name="filled",
    cerebrum=(1, 2),
    cortex=(2,),
)
"""Scheme of volumes filled from surfaces."""


def _as_text(labels: list[int]) -> str:
    return ", ".join(map(str, labels))
