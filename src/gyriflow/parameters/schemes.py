"""Label schemes: which numbers of a tissue label volume make the cerebrum, the cortex, left and right."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from .settings import Problem, Settings, check, setting

Label = Annotated[int, Field(ge=1, le=2**31 - 1)]


class SchemeSettings(Settings):
    """The meaning of the labels of a volume; 0 is background. A brain refers to it by name: `scheme: NAME`."""

    cerebrum: tuple[Label, ...] = setting(
        ..., "", "Labels that together fill the cerebrum inside the pial surface; each must occur in the volume."
    )
    cortex: tuple[Label, ...] = setting(
        (), "", "Those that are cortex; with them the fissure is opened and cortical thickness estimated."
    )
    left: tuple[Label, ...] = setting(
        (), "", "Those that lie in the left hemisphere only; with `right`, they separate the hemispheres."
    )
    right: tuple[Label, ...] = setting((), "", "Those that lie in the right hemisphere only.")
    known: dict[Label, str] = setting(
        {}, "", "Tissue by label, such as `{4: outer CSF}`; every label that is in no list must be named here."
    )

    @property
    def labels(self) -> dict[int, str]:
        """Tissue name of each label; one without a name is called after the list that it is in."""
        named = {label: "cortex" if label in self.cortex else "cerebrum" for label in self.cerebrum}
        return dict(sorted((named | self.known).items()))

    @check
    def _some_cerebrum(self) -> Iterator[Problem]:
        if not self.cerebrum:
            yield Problem("found no labels; it should have one or more", ("cerebrum",))

    @check
    def _labels_of_the_cerebrum_once(self) -> Iterator[Problem]:
        for key in ("cerebrum", "cortex", "left", "right"):
            if not self.has(key):
                continue
            labels = getattr(self, key)
            if twice := sorted({label for label in labels if labels.count(label) > 1}):
                yield Problem(f"found {_listed(twice)} more than once", (key,))
            if self.has("cerebrum") and (outside := sorted(set(labels) - set(self.cerebrum))):
                yield Problem(f"found {_listed(outside)}; it should have labels of the cerebrum only", (key,))

    @check
    def _something_inside_the_cortex(self) -> Iterator[Problem]:
        if self.cortex and set(self.cerebrum) <= set(self.cortex):
            yield Problem("found all of the cerebrum; the tissue inside the cortex is missing", ("cortex",))

    @check
    def _both_hemispheres_or_none(self) -> Iterator[Problem]:
        if both := sorted(set(self.left) & set(self.right)):
            yield Problem(f"found {_listed(both)}, which are in left too", ("right",))
        if bool(self.left) != bool(self.right):
            missing = "right" if self.left else "left"
            yield Problem("is missing; the hemispheres are separated by both left and right", (missing,))


class LabelScheme(SchemeSettings):
    """A label scheme with its name."""

    name: str = setting(..., "", "The scheme's name.")


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        LabelScheme(
            # Fidon et al. 2021, Open Research Europe, doi 10.5281/zenodo.5524312
            name="spina-bifida-atlas",
            cerebrum=(1, 2, 5, 6, 8),
            cortex=(5,),
            known={
                1: "white matter",
                2: "ventricles",
                3: "cerebellum",
                4: "outer CSF",
                5: "cortex",
                6: "deep grey matter",
                7: "brainstem",
                8: "corpus callosum",
            },
        ),
        LabelScheme(
            # dHCP fetal brain atlas, Uus et al. 2023, gin.g-node.org/kcl_cdb/fetal_brain_mri_atlas
            name="dhcp-19",
            cerebrum=(3, 4, 5, 6, 7, 8, 9, 14, 15, 16, 17),
            cortex=(3, 4),
            left=(3, 5, 7, 14, 16),
            right=(4, 6, 8, 15, 17),
            known={
                1: "outer CSF, left",
                2: "outer CSF, right",
                3: "cortex, left",
                4: "cortex, right",
                5: "white matter, left",
                6: "white matter, right",
                7: "lateral ventricle, left",
                8: "lateral ventricle, right",
                9: "third ventricle",
                10: "brainstem",
                11: "cerebellum, left",
                12: "cerebellum, right",
                13: "cerebellar vermis",
                14: "basal ganglia, left",
                15: "basal ganglia, right",
                16: "thalamus, left",
                17: "thalamus, right",
                18: "fourth ventricle",
                19: "other midline CSF",
            },
        ),
        LabelScheme(
            # FeTA challenge, Payette et al. 2021, Scientific Data 8:167
            name="feta-7",
            cerebrum=(2, 3, 4, 6),
            cortex=(2,),
            known={
                1: "outer CSF",
                2: "cortex",
                3: "white matter",
                4: "ventricles",
                5: "cerebellum",
                6: "deep grey matter",
                7: "brainstem",
            },
        ),
        LabelScheme(name="binary", cerebrum=(1,)),
    )
}
"""The schemes that come with gyriflow, by name; a further one is a further entry here."""


def _listed(labels: list[int]) -> str:
    return ", ".join(map(str, labels))
