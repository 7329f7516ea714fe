"""Label schemes: the names of those that come with gyriflow, and the settings of further ones."""

from typing import Annotated, Any

from pydantic import Field

from .base import Settings, setting

BUILT_IN_SCHEMES = (
    "spina-bifida-atlas",
    "dhcp-19",
    "feta-7",
    "drawem-9",
    "multi-bounti-43",
    "freesurfer",
    "crl",
    "binary",
)
"""Names that a brain's `scheme` may have without an entry of `schemes`."""

Label = Annotated[int, Field(ge=1, le=2**31 - 1)]


class SchemeSettings(Settings):
    """What the labels of a volume mean; 0 is background. A brain uses it by its name, as `scheme: NAME`."""

    cerebrum: tuple[Label, ...] = setting(
        ..., "", "Labels that together fill the cerebrum inside the pial surface; not all have to be there."
    )
    cortex: tuple[Label, ...] = setting(
        (), "",
        "Those of them that are cortex, of which some have to be there; with them, the fissure is opened and cortical "
        "thickness estimated.",
    )  # fmt: skip
    left: tuple[Label, ...] = setting(
        (), "", "Those of them that lie in the left hemisphere only; with `right`, they part the hemispheres."
    )
    right: tuple[Label, ...] = setting((), "", "Those of them that lie in the right hemisphere only.")
    white_matter: tuple[Label, ...] = setting((), "", "Those of them that are white matter; some have to be there.")
    ventricles: tuple[Label, ...] = setting(
        (), "", "Those of them that are fluid; what of it the cerebrum's tissue does not enclose is left out."
    )
    cerebellum: tuple[Label, ...] = setting((), "", "Labels of the cerebellum; with `brainstem`, they tell the pose.")
    brainstem: tuple[Label, ...] = setting((), "", "Labels of the brainstem.")
    known: dict[Label, str] = setting(
        {}, "", "Tissue by label, as `{4: outer CSF}`; any label that is in no list has to stand here."
    )


def scheme_problems(name: str, raw: Any) -> list[str]:
    """Returns what is wrong between the keys of one entry of `schemes` (raw), each with its key in front."""
    where = f"schemes.{name}"
    problems = [f"{where}: the name is that of a scheme of gyriflow; choose another"] * (name in BUILT_IN_SCHEMES)
    if not isinstance(raw, dict):
        return problems
    inside = ("cerebrum", "cortex", "left", "right", "white_matter", "ventricles")
    lists = {key: raw.get(key) or [] for key in inside}
    if not all(isinstance(labels, list) and all(isinstance(n, int) for n in labels) for labels in lists.values()):
        return problems
    if "cerebrum" in raw and not lists["cerebrum"]:
        problems.append(f"{where}.cerebrum: found no labels; it should have one or more")
    for key, labels in lists.items():
        twice = sorted({n for n in labels if labels.count(n) > 1})
        if twice:
            problems.append(f"{where}.{key}: found {_listed(twice)} more than once")
        outside = sorted(set(labels) - set(lists["cerebrum"]))
        if outside:
            problems.append(f"{where}.{key}: found {_listed(outside)}; it should have labels of the cerebrum only")
    if lists["cortex"] and set(lists["cerebrum"]) <= set(lists["cortex"]):
        problems.append(f"{where}.cortex: found all of the cerebrum; the tissue inside the cortex is missing")
    both = sorted(set(lists["left"]) & set(lists["right"]))
    if both:
        problems.append(f"{where}.right: found {_listed(both)}, which are in left too")
    if bool(lists["left"]) != bool(lists["right"]):
        missing = "right" if lists["left"] else "left"
        problems.append(f"{where}.{missing}: is missing; hemispheres are told apart by both left and right")
    return problems


def _listed(labels: list[int]) -> str:
    return ", ".join(map(str, labels))
