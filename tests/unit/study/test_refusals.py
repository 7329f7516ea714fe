"""What is wrong in a section of a configuration, and the key and the facts with which
it is refused: a mistake a line."""

import pytest
from configurations import brain, cases, problems, study, touched
from facts import Facts

FILES = "a.nii.gz t.mgz t2w.nii.gz l.gii r.gii all.stl w.stl"
COMPARED = {"base": "reference", "compare_week": 22.5}
SWEEP = COMPARED | {"vary": {"thickness_mm": [0.8, 1.5]}}
SEARCH = COMPARED | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}
SERIES = [
    *(brain(f"v{week}", week) for week in (21, 22)),
    *({"id": f"s{week}", "week": week, "pial": "all.stl"} for week in (21, 22)),
]
WITH = {
    "study": lambda wrong: study(**wrong),
    "brain": lambda wrong: study([{"id": "a", "week": 21} | wrong]),
    "folding": lambda wrong: study(folding={"end_week": 24} | wrong),
    "metrics": lambda wrong: study([brain("a", 21)], metrics=wrong),
    "half": lambda wrong: study([brain("a", 21) | {"side": "left"}], metrics=wrong),
    "growth": lambda wrong: study(SERIES, start="v21", growth=wrong),
    "sweep": lambda wrong: study(sweeps={"s": SWEEP | wrong}),
    "search": lambda wrong: study(calibrate=SEARCH | wrong),
}
"""Configurations, by the section that a mistake is added to."""
OF_PYTHON = ("tuple", "dict", "instance", "datetime")


@pytest.fixture
def folder(tmp_path):
    return touched(tmp_path, *FILES.split())


@cases(
    ("section", "wrong", "key", "facts"),
    """
    study | {mesh: [{order: 2}]} | mesh | [keys]
    study | {mesh: {surface_edge_mm: "0,8"}} | mesh.surface_edge_mm | [write 0.8]
    study | {mesh: {surface_edge_mm: 0.8 mm}} | mesh.surface_edge_mm | [number]
    study | {start: 2026-11-29} | start | ["2026-11-29", quotes]
    study | {start: off} | start | ["no", "off", quotes]
    study | {start: 17} | start | [17, quotes]
    study | {runs: {NUL: {}}} | runs.NUL | [NUL, Windows]
    study | {brains: [l.nii.gz]} | "brains[0]" | [keys]
    brain | {labels: a.nii.gz, scheme: binary, pial: all.stl} | "" | [labels, shape]
    brain | {} | "" | [labels, hemispheres, pial, shape]
    brain | {labels: a.nii.gz} | .scheme | []
    brain | {labels: a.nii.gz, scheme: d} | .scheme | [d, "binary, crl"]
    brain | {image: t2w.nii.gz} | .image | [labels]
    brain | {pial: lost.stl} | .pial | [lost.stl]
    brain | {hemispheres: {left: l.gii}} | .hemispheres.right | []
    brain | {hemispheres: {left: l.gii, right: r.gii}, white: w.stl} | .white | []
    brain | {hemispheres: {left: l.gii, right: r.gii}, side: left} | .side | [pial]
    brain | {labels: a.nii.gz, side: left} | .scheme | []
    brain | {labels: a.nii.gz, scheme: binary, coordinates: ras} | .coordinates | [pial]
    brain | {pial: l.gii, side: left, scheme: binary} | .scheme | [labels]
    brain | {labels: a.nii.gz, side: middle, scheme: binary} | .side | [left, right]
    brain | {shape: {}, population: sheep} | .population | [shape, pial]
    brain | {shape: {semi_axes_mm: [4, 9, 9]}} | ".shape.semi_axes_mm[0]" | [4, 5]
    brain | {shape: {semi_axes_mm: [10, 21, 12]}} | .shape.semi_axes_mm | [21, 2]
    brain | {week: 50, pial: all.stl} | .week | [50, 45]
    brain | {week: 22+7, pial: all.stl} | .week | [22+7, 24+2]
    folding | {thickness_mm: 0} | thickness_mm | [0]
    folding | {thickness_mm: {weeks: {21: true}}} | thickness_mm.weeks | [21, true]
    folding | {thickness_mm: {map: x.shape.gii}} | thickness_mm.map | [x.shape.gii]
    folding | {step_s: fast} | step_s | [fast]
    folding | {step_s: true} | step_s | [true]
    folding | {stress_memory_gw: forever} | stress_memory_gw | [0, infinite, forever]
    folding | {growth_rate_per_s: .nan} | growth_rate_per_s | [nan]
    folding | {growth_rate_per_s: -1.0e-8} | growth_rate_per_s | [0, -1.0e-8]
    folding | {fields: [tension]} | "fields[0]" | [displacement, tension]
    folding | {contact: walls} | contact | [global, planes, none, walls]
    folding | {end_week: 21} | end_week | [21, a]
    folding | {growth_rate_per_s: 1.0e-5, step_s: 604800} | step_s | [604800, 6.05]
    folding | {growth: {area_cm2: {21: 9}}} | growth.area_cm2 | [rates, sizes]
    folding | {growth: {model: sizes, of: atlas}} | growth.of | [sizes, shapes]
    folding | {growth: shape} | growth.model | [shape, rates, sizes, shapes]
    metrics | {regions: {a: {}}} | regions.a.labels | []
    metrics | {regions: {a: {labels: a.nii.gz}}} | regions.a.names | []
    metrics | {regions: {a: {labels: l.gii}}} | regions.a.labels | []
    metrics | {regions: {a: {labels: [l.gii, r.gii]}}} | regions.a.surface | []
    metrics | {regions: {a: {labels: t.mgz, surface: l.gii}}} | regions.a.surface | []
    metrics | {regions: {q: {labels: a.nii.gz, names: {1: x}}}} | regions | [q, a]
    metrics | {norm_reference: [x]} | norm_reference | [x, a]
    half | {regions: {a: {labels: a.nii.gz, names: {1: x}}}} | regions | [a]
    growth | {brains: {n: [v21, x], m: [v21, v22]}} | brains.n | [x, "v21, v22, s21"]
    growth | {brains: {n: [v21, s21], m: [v21, v22]}} | brains.n | [1]
    growth | {brains: []} | brains | [0]
    growth | {brains: {}} | brains | [0]
    growth | {series: volumes} | series | [volumes, "surface, volume"]
    growth | {brains: {n: v21}} | brains.n | [v21]
    sweep | {vary: {thicknes_mm: [1]}} | vary.thicknes_mm | []
    sweep | {vary: {thickness_mm: [-1]}} | vary.thickness_mm | [0, -1]
    sweep | {vary: {thickness_mm: [1, 1]}} | vary.thickness_mm | [[1.0, 1.0]]
    sweep | {vary: {preset: [measured]}} | vary.preset | [base]
    sweep | {vary: {growth_rate_per_s: [1.0e-5], step_s: [6.0e+5]}} | vary.step_s | [6]
    sweep | {vary: {}} | vary | [folding]
    sweep | {fixed: {contact.gap: 2}} | fixed.contact.gap | []
    sweep | {fixed_at: {1.2: {step_s: 43200}}} | fixed_at | [1.2]
    sweep | {fixed_at: {1.5: {steps: 1}}} | fixed_at.steps | []
    sweep | {base: ref} | base | [ref, reference]
    sweep | {compare_week: 24} | compare_week | [24, 21, 22.5]
    sweep | {compare_with: [a]} | compare_with | [a, 21, 22.5]
    search | {parameters: {step_s: [2, 2]}} | parameters.step_s | [[2.0, 2.0]]
    search | {parameters: {thickness_mm: [-1, 1]}} | parameters.thickness_mm | [0, -1]
    search | {parameters: {poisson: [0, 0.4]}} | parameters.poisson | []
    search | {parameters: {preset: [0, 0.4]}} | parameters.preset | []
    search | {parameters: {}} | parameters | [0, 1]
    search | {rounds: [30, 11]} | rounds | [[30, 11], 3, 40]
    search | {score: {}} | score | [shape_index, surface_distance]
    search | {score: {beauty: 1}} | score.beauty | [beauty, shape_index]
    search | {compare_week: 24} | compare_week | [24, 21, 22.5]
    """,
)
def test_a_mistake_is_named_with_its_key_and_what_is_expected(
    folder, section, wrong, key, facts
):
    places = {"study": "", "brain": "brains[0]", "half": "metrics."}
    places |= {"sweep": "sweeps.s.", "search": "calibrate."}
    place = places.get(section, f"{section}.")
    (found,) = problems(WITH[section](wrong), folder)
    assert found == Facts(f"{place}{key}:", *facts)
    assert not any(word in found for word in OF_PYTHON)
