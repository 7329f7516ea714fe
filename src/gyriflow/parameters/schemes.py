"""Label schemes: which numbers of a tissue label volume make the cerebrum, the cortex, left and right."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from .settings import Problem, Settings, check, setting

Label = Annotated[int, Field(ge=1, le=2**31 - 1)]


class SchemeSettings(Settings):
    """The meaning of the labels of a volume; 0 is background. A brain refers to it by name: `scheme: NAME`."""

    cerebrum: tuple[Label, ...] = setting(
        ..., "", "Labels that together fill the cerebrum inside the pial surface; not all must occur in the volume."
    )
    cortex: tuple[Label, ...] = setting(
        (), "",
        "Those that are cortex, of which some must occur; with them the fissure is opened and cortical thickness "
        "estimated.",
    )  # fmt: skip
    left: tuple[Label, ...] = setting(
        (), "", "Those that lie in the left hemisphere only; with `right`, they separate the hemispheres."
    )
    right: tuple[Label, ...] = setting((), "", "Those that lie in the right hemisphere only.")
    white_matter: tuple[Label, ...] = setting((), "", "Those that are white matter, of which some must occur.")
    ventricles: tuple[Label, ...] = setting(
        (), "", "Those that are fluid; what of it the cerebrum's tissue does not enclose is left out."
    )
    cerebellum: tuple[Label, ...] = setting(
        (), "", "Labels of the cerebellum, outside the cerebrum; with `brainstem`, they tell the pose of the volume."
    )
    brainstem: tuple[Label, ...] = setting((), "", "Labels of the brainstem, outside the cerebrum.")
    known: dict[Label, str] = setting(
        {}, "", "Tissue by label, such as `{4: outer CSF}`; every label that is in no list must be named here."
    )

    @property
    def labels(self) -> dict[int, str]:
        """Tissue name of each label; one without a name is called after the list that it is in."""
        named = dict.fromkeys(self.cerebrum, "cerebrum")
        for tissue in ("white_matter", "ventricles", "cortex", "cerebellum", "brainstem"):
            named |= dict.fromkeys(getattr(self, tissue), tissue.replace("_", " "))
        return dict(sorted((named | self.known).items()))

    @check
    def _some_cerebrum(self) -> Iterator[Problem]:
        if not self.cerebrum:
            yield Problem("found no labels; it should have one or more", ("cerebrum",))

    @check
    def _labels_of_the_cerebrum_once(self) -> Iterator[Problem]:
        for key in ("cerebrum", "cortex", "left", "right", "white_matter", "ventricles"):
            if not self.has(key):
                continue
            labels = getattr(self, key)
            if twice := sorted({label for label in labels if labels.count(label) > 1}):
                yield Problem(f"found {_as_text(twice)} more than once", (key,))
            if self.has("cerebrum") and (outside := sorted(set(labels) - set(self.cerebrum))):
                yield Problem(f"found {_as_text(outside)}; it should have labels of the cerebrum only", (key,))

    @check
    def _something_inside_the_cortex(self) -> Iterator[Problem]:
        if self.cortex and set(self.cerebrum) <= set(self.cortex):
            yield Problem("found all of the cerebrum; the tissue inside the cortex is missing", ("cortex",))

    @check
    def _both_hemispheres_or_none(self) -> Iterator[Problem]:
        if both := sorted(set(self.left) & set(self.right)):
            yield Problem(f"found {_as_text(both)}, which are in left too", ("right",))
        if bool(self.left) != bool(self.right):
            missing = "right" if self.left else "left"
            yield Problem("is missing; the hemispheres are separated by both left and right", (missing,))


class LabelScheme(SchemeSettings):
    """A label scheme with its name."""

    name: str = setting(..., "", "The scheme's name.")


def _as_text(labels: list[int]) -> str:
    return ", ".join(map(str, labels))


_SPINA_BIFIDA_ATLAS = LabelScheme(
    # Fidon et al. 2021, Open Research Europe, doi 10.5281/zenodo.5524312
    name="spina-bifida-atlas",
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
    cerebrum=(1, 2, 5, 6, 8),
    cortex=(5,),
    white_matter=(1,),
    ventricles=(2,),
    cerebellum=(3,),
    brainstem=(7,),
)

_DHCP_19 = LabelScheme(
    # BOUNTI, the labels of the dHCP fetal brain atlas: Uus et al. 2023, doi 10.7554/eLife.88818;
    # names as in github.com/SVRTK/auto-proc-svrtk, scripts/auto-reporting-brain-volumetry-html.py
    name="dhcp-19",
    known={
        1: "outer CSF, left",
        2: "outer CSF, right",
        3: "cortex, left",
        4: "cortex, right",
        5: "white matter, left",
        6: "white matter, right",
        7: "lateral ventricle, left",
        8: "lateral ventricle, right",
        9: "cavum septi pellucidi",
        10: "brainstem",
        11: "cerebellum, left",
        12: "cerebellum, right",
        13: "cerebellar vermis",
        14: "basal ganglia, left",
        15: "basal ganglia, right",
        16: "thalamus, left",
        17: "thalamus, right",
        18: "third ventricle",
        19: "fourth ventricle",
    },
    cerebrum=(3, 4, 5, 6, 7, 8, 9, 14, 15, 16, 17, 18),
    cortex=(3, 4),
    left=(3, 5, 7, 14, 16),
    right=(4, 6, 8, 15, 17),
    white_matter=(5, 6),
    ventricles=(7, 8, 9, 18),
    cerebellum=(11, 12, 13),
    brainstem=(10,),
)

_FETA_7 = LabelScheme(
    # FeTA challenge, Payette et al. 2021, Scientific Data 8:167
    name="feta-7",
    known={
        1: "outer CSF",
        2: "cortex",
        3: "white matter",
        4: "ventricles",
        5: "cerebellum",
        6: "deep grey matter",
        7: "brainstem",
    },
    cerebrum=(2, 3, 4, 6),
    cortex=(2,),
    white_matter=(3,),
    ventricles=(4,),
    cerebellum=(5,),
    brainstem=(7,),
)

_DRAWEM_9 = LabelScheme(
    # Draw-EM, Makropoulos et al. 2014, doi 10.1109/TMI.2014.2322280: tissue_labels of the dHCP structural pipeline;
    # the fetal parameters of github.com/MIRTK/DrawEM give 9 to the cavum septi pellucidi
    name="drawem-9",
    known={
        1: "outer CSF",
        2: "cortex",
        3: "white matter",
        4: "background inside the head",
        5: "ventricles",
        6: "cerebellum",
        7: "deep grey matter",
        8: "brainstem",
        9: "hippocampus and amygdala, or cavum septi pellucidi",
    },
    cerebrum=(2, 3, 5, 7, 9),
    cortex=(2,),
    white_matter=(3,),
    ventricles=(5,),
    cerebellum=(6,),
    brainstem=(8,),
)


def _multi_bounti() -> LabelScheme:
    """Returns the 43 labels of Multi-BOUNTI, right before left: github.com/SVRTK/perinatal-brain-mri-analysis."""
    lobes = ("frontal", "parietal", "occipital", "insular", "temporal", "cingulate")
    labels: dict[int, str] = {}
    for tissue, first in (("cortex", 1), ("white matter", 13)):
        for place, lobe in enumerate(lobes):
            labels[first + 2 * place], labels[first + 2 * place + 1] = (
                f"{lobe} {tissue}, {side}" for side in ("right", "left")
            )
    labels |= {25: "corpus callosum", 26: "background inside the cerebrum", 27: "brainstem", 30: "cerebellar vermis"}
    labels |= {41: "cavum septi pellucidi", 42: "third ventricle", 43: "fourth ventricle"}
    pairs = {
        28: "cerebellum",
        31: "caudate nucleus",
        33: "lentiform nucleus",
        35: "thalamus",
        37: "outer CSF",
        39: "lateral ventricle",
    }
    for number, tissue in pairs.items():
        labels[number], labels[number + 1] = f"{tissue}, right", f"{tissue}, left"
    deep = (31, 33, 35, 39)
    return LabelScheme(
        name="multi-bounti-43",
        known=dict(sorted(labels.items())),
        cerebrum=(*range(1, 27), *range(31, 37), 39, 40, 41, 42),
        cortex=tuple(range(1, 13)),
        left=(*range(2, 25, 2), *(number + 1 for number in deep)),
        right=(*range(1, 24, 2), *deep),
        white_matter=tuple(range(13, 25)),
        ventricles=(39, 40, 41, 42),
        cerebellum=(28, 29, 30),
        brainstem=(27,),
    )


def _freesurfer() -> LabelScheme:
    """Returns the labels of aseg, aparc+aseg, aparc.a2009s+aseg and wmparc volumes, as in FreeSurferColorLUT.txt."""
    sided = {  # left, right
        (2, 41): "cerebral white matter",
        (3, 42): "cerebral cortex",
        (4, 43): "lateral ventricle",
        (5, 44): "inferior lateral ventricle",
        (9, 48): "thalamus",
        (10, 49): "thalamus",
        (11, 50): "caudate",
        (12, 51): "putamen",
        (13, 52): "pallidum",
        (17, 53): "hippocampus",
        (18, 54): "amygdala",
        (25, 57): "lesion",
        (26, 58): "accumbens area",
        (28, 60): "ventral diencephalon",
        (30, 62): "vessel",
        (31, 63): "choroid plexus",
        (78, 79): "white matter hypointensities",
        (81, 82): "non-white-matter hypointensities",
        (5001, 5002): "unsegmented white matter",
    }
    sided |= {(1000 + n, 2000 + n): f"cortex, area {n}" for n in range(36)}
    sided |= {(11100 + n, 12100 + n): f"cortex, area {n} of a2009s" for n in range(76)}
    sided |= {(3000 + n, 4000 + n): f"white matter of area {n}" for n in range(36)}
    middle = {14: "third ventricle", 72: "fifth ventricle", 77: "white matter hypointensities", 192: "corpus callosum"}
    middle |= {80: "non-white-matter hypointensities"}
    middle |= dict.fromkeys(range(251, 256), "corpus callosum")
    outside = {7: "cerebellar white matter, left", 8: "cerebellar cortex, left", 15: "fourth ventricle"}
    outside |= {46: "cerebellar white matter, right", 47: "cerebellar cortex, right", 16: "brainstem"}
    outside |= {24: "outer CSF", 85: "optic chiasm", 1: "cerebral exterior, left", 40: "cerebral exterior, right"}
    outside |= {6: "cerebellar exterior, left", 45: "cerebellar exterior, right", 257: "outer CSF"}
    labels = middle | outside
    for pair, tissue in sided.items():
        labels[pair[0]], labels[pair[1]] = f"{tissue}, left", f"{tissue}, right"
    left, right = (tuple(pair[side] for pair in sided) for side in (0, 1))
    fluid = ("ventricle", "choroid")

    def named(*words: str) -> tuple[int, ...]:
        inside = (*left, *right, *middle)
        return tuple(number for number in inside if any(word in labels[number] for word in words))

    return LabelScheme(
        name="freesurfer",
        known=dict(sorted(labels.items())),
        cerebrum=(*left, *right, *middle),
        cortex=(3, 42, *(n for pair, tissue in sided.items() if tissue.startswith("cortex") for n in pair)),
        left=left,
        right=right,
        white_matter=(2, 41, 5001, 5002, *named("white matter of")),
        ventricles=named(*fluid),
        cerebellum=(7, 8, 46, 47),
        brainstem=(16,),
    )


def _crl() -> LabelScheme:
    """Returns the tissue and regional labels of CRL's fetal brain atlas: Gholipour et al. 2017.

    doi 10.1038/s41598-017-00525-w. Regions 1 to 90 have the numbers of AAL, odd on the left.
    """
    deep = {37: "hippocampus", 41: "amygdala", 71: "caudate", 73: "putamen", 75: "pallidum", 77: "thalamus"}
    deep |= {108: "subthalamic nucleus"}
    zones = {114: "subplate", 116: "intermediate zone", 118: "ventricular zone", 120: "white matter"}
    zones |= {122: "internal capsule"}
    areas = {n: f"cortex, area {n}" for n in range(1, 90, 2) if n not in deep}
    pairs = areas | deep | zones | {92: "lateral ventricle", 112: "cortical plate"}
    labels = {number: f"{tissue}, left" for number, tissue in pairs.items()}
    labels |= {number + 1: f"{tissue}, right" for number, tissue in pairs.items()}
    labels |= {91: "corpus callosum", 94: "midbrain, left", 95: "midbrain, right", 110: "hippocampal commissure"}
    labels |= {100: "cerebellum, left", 101: "cerebellum, right", 111: "fornix", 124: "CSF", 125: "other tissue"}
    cortex = (*areas, 112)
    return LabelScheme(
        name="crl",
        known=dict(sorted(labels.items())),
        cerebrum=tuple(number for number in sorted(labels) if number not in (94, 95, 100, 101, 124)),
        cortex=tuple(sorted((*cortex, *(number + 1 for number in cortex)))),
        left=tuple(pairs),
        right=tuple(number + 1 for number in pairs),
        white_matter=tuple(n for number in zones for n in (number, number + 1)),
        ventricles=(92, 93),
        cerebellum=(100, 101),
        brainstem=(94, 95),
    )


_BINARY = LabelScheme(name="binary", cerebrum=(1,))

_BUILT_IN = (_SPINA_BIFIDA_ATLAS, _DHCP_19, _FETA_7, _DRAWEM_9, _multi_bounti(), _freesurfer(), _crl(), _BINARY)

SCHEMES = {scheme.name: scheme for scheme in _BUILT_IN}
"""The schemes that come with gyriflow, by name; a further one is a further entry here."""
