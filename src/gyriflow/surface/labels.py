"""Label schemes: which numbers of a tissue label volume make the cerebrum, the cortex, left and right."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyriflow.errors import InputError


@dataclass(frozen=True)
class LabelScheme:
    """What the numbers of a label volume mean; 0 is background.

    Attributes
    ----------
    name
        The scheme's name in the config.
    labels
        Tissue name of each number.
    cerebrum
        Numbers that together fill the cerebrum inside the pial surface.
    cortex
        Numbers of cortical grey matter; empty where the scheme has none.
    left, right
        Numbers that lie in one hemisphere only; empty where the scheme has no sides.
    """

    name: str
    labels: dict[int, str]
    cerebrum: tuple[int, ...]
    cortex: tuple[int, ...] = ()
    left: tuple[int, ...] = ()
    right: tuple[int, ...] = ()


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        LabelScheme(
            # Fidon et al. 2021, Open Research Europe, doi 10.5281/zenodo.5524312
            "spina-bifida-atlas",
            {
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
        ),
        LabelScheme(
            # dHCP fetal brain atlas, Uus et al. 2023, gin.g-node.org/kcl_cdb/fetal_brain_mri_atlas
            "dhcp-19",
            {
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
            cerebrum=(3, 4, 5, 6, 7, 8, 9, 14, 15, 16, 17),
            cortex=(3, 4),
            left=(3, 5, 7, 14, 16),
            right=(4, 6, 8, 15, 17),
        ),
        LabelScheme(
            # FeTA challenge, Payette et al. 2021, Scientific Data 8:167
            "feta-7",
            {
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
        ),
        LabelScheme("binary", {1: "cerebrum"}, cerebrum=(1,)),
    )
}


def label_scheme(
    name: str,
    cerebrum: Sequence[int] = (),
    cortex: Sequence[int] = (),
    left: Sequence[int] = (),
    right: Sequence[int] = (),
    known: Mapping[int, str] | None = None,
) -> LabelScheme:
    """Returns the scheme of a name, or one of one's own, made of what its numbers are.

    `known` gives the tissues of numbers, also of those outside the cerebrum; one of the cerebrum without a name there
    is called after the list that it is in.
    """
    if not cerebrum:
        return SCHEMES[name]
    labels = {number: "cortex" if number in cortex else "cerebrum" for number in cerebrum} | dict(known or {})
    return LabelScheme(name, dict(sorted(labels.items())), tuple(cerebrum), tuple(cortex), tuple(left), tuple(right))


def cerebrum_mask(labels: NDArray[np.integer], scheme: LabelScheme) -> NDArray[np.bool_]:
    """Returns where the (i, j, k) labels belong to the cerebrum.

    InputError names the labels that the scheme does not know and the tissues of the cerebrum that are missing.
    """
    present = set(np.unique(labels).tolist()) - {0}
    known = ", ".join(f"{number} {tissue}" for number, tissue in scheme.labels.items())
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that the scheme {scheme.name!r} does not know",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=known,
            remedy=f"Choose another scheme ({', '.join(sorted(SCHEMES))}), or write one under schemes. Is this an "
            "image? gyriflow does not segment.",
        )
    if not present & set(scheme.cerebrum):
        raise InputError(
            "no voxel belongs to the cerebrum",
            found=f"labels {_listed(sorted(present)) or 'none but 0'}",
            expected="voxels of " + ", ".join(f"{n} {scheme.labels[n]}" for n in scheme.cerebrum),
            remedy="Check that this is the label volume and the scheme is its own.",
        )
    missing = [number for number in scheme.cerebrum if number not in present]
    if missing:
        raise InputError(
            f"tissues of the scheme {scheme.name!r} are missing from the label volume",
            found=f"labels {_listed(sorted(present))}",
            expected="also " + ", ".join(f"{number} {scheme.labels[number]}" for number in missing),
            remedy="Choose the scheme of this volume.",
        )
    return np.isin(labels, scheme.cerebrum)


def require_sides(
    labels: NDArray[np.integer], scheme: LabelScheme, affine: NDArray[np.float64], to_right: NDArray[np.float64]
) -> None:
    """Raises InputError where labels of the left hemisphere lie to the right of those of the right hemisphere.

    `to_right` (3,) is the direction from left to right in the coordinates that the (4, 4) affine leads to.
    """
    if not scheme.left:
        return
    left, right = (
        float(to_right @ affine[:3, :3] @ np.argwhere(np.isin(labels, side)).mean(axis=0))
        for side in (scheme.left, scheme.right)
    )
    if left >= right:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"{left - right:.1f} mm to the right of those of the right hemisphere",
            expected="left at the smaller x (RAS+)",
            remedy="The volume's affine mirrors the brain, or the scheme's sides are swapped.",
        )


def _listed(numbers: list[int]) -> str:
    shown = ", ".join(map(str, numbers[:20]))
    return f"{shown}, … ({len(numbers)} in all)" if len(numbers) > 20 else shown
