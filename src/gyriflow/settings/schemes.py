"""Label schemes: which numbers of a tissue label volume make the cerebrum, the cortex, left and right.

Those that come with gyriflow are the files of `schemes`; `io.yaml_files` reads them.
"""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from ..shipped import SHIPPED
from .base import KeyProblem, Settings

SCHEME_FILES = {path.stem: path for path in sorted((SHIPPED / "schemes").glob("*.yaml"))}
"""The files of the schemes that come with gyriflow, by name."""
Label = Annotated[int, Field(ge=1, le=2**31 - 1)]


class SchemeSettings(Settings):
    """What the labels of a volume mean; 0 is background. A brain names its scheme: `scheme: NAME`."""

    cerebrum: tuple[Label, ...]
    """Labels that together fill the cerebrum inside the pial surface; not all need occur."""
    cortex: tuple[Label, ...] = ()
    """Those of the cortex, of which some must occur: for opening the fissure, and for cortical thickness."""
    left: tuple[Label, ...] = ()
    """Those of the left hemisphere only, which with `right` part the brain."""
    right: tuple[Label, ...] = ()
    """Those of the right hemisphere only."""
    white_matter: tuple[Label, ...] = ()
    """Those of white matter, of which some must occur."""
    ventricles: tuple[Label, ...] = ()
    """Those of fluid, which is left out where tissue does not enclose it."""
    cerebellum: tuple[Label, ...] = ()
    """Labels outside the cerebrum; with `brainstem`, for the pose."""
    brainstem: tuple[Label, ...] = ()
    """Labels of the brainstem, outside the cerebrum."""
    known: dict[Label, str] = Field({})
    """Tissue by label, such as `{4: outer CSF}`; every label in no list must be named here."""

    @property
    def labels(self) -> dict[int, str]:
        # a label without a name is called after the list that it is in
        named = dict.fromkeys(self.cerebrum, "cerebrum")
        for tissue in ("white_matter", "ventricles", "cortex", "cerebellum", "brainstem"):
            named |= dict.fromkeys(getattr(self, tissue), tissue.replace("_", " "))
        return dict(sorted((named | self.known).items()))

    def problems(self) -> Iterator[KeyProblem]:
        if not self.cerebrum:
            yield KeyProblem("found no labels; it should have one or more", ("cerebrum",))
        for key in ("cerebrum", "cortex", "left", "right", "white_matter", "ventricles"):
            labels = getattr(self, key)
            if twice := sorted({label for label in labels if labels.count(label) > 1}):
                yield KeyProblem(f"found {_as_text(twice)} more than once", (key,))
            if outside := sorted(set(labels) - set(self.cerebrum)):
                yield KeyProblem(f"found {_as_text(outside)}; it should have labels of the cerebrum only", (key,))
        if self.cortex and set(self.cerebrum) <= set(self.cortex):
            yield KeyProblem("found all of the cerebrum; the tissue inside the cortex is missing", ("cortex",))
        if both := sorted(set(self.left) & set(self.right)):
            yield KeyProblem(f"found {_as_text(both)}, which are in left too", ("right",))
        if bool(self.left) != bool(self.right):
            missing = "right" if self.left else "left"
            yield KeyProblem("is missing; the hemispheres are separated by both left and right", (missing,))


class LabelScheme(SchemeSettings):
    """A label scheme with its name."""

    name: str
    """The scheme's name."""


def _as_text(labels: list[int]) -> str:
    return ", ".join(map(str, labels))
