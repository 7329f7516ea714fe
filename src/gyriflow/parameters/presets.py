"""Sets of parameters by name, which a configuration starts from; its own keys come on top."""

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # the paper's model, whatever the defaults become; its linear elements are `order: 1` of the mesh
    "fetalfoldsim": {
        "step_s": 43_200.0,
        "time_scheme": "implicit",
        "follow": None,
        "allow_negative_growth": False,
        "thickness_mm": 1.5,
        "thickness_growth_mm_per_gw": 0.0,
        "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": 300.0,
        "material": "neo-hookean",
        "poisson_ratio": 0.45,
        "growth_rate_per_s": 2.0e-7,
        "radial_growth_rate_per_s": 0.0,
        "core_growth_rate_per_s": 0.0,
        "stress_memory_gw": 0.0,
        "support": "ellipsoid",
        "contact": {"kind": "planes", "penalty_pa_per_m": 5.0e5, "gap_mm": 2.5},
        "no_growth": {"kind": "ellipsoid", "shift_y": 0.05, "shift_z": -0.15, "semi_axes": [0.35, 0.40, 0.50]},
    },
    # growth that follows the brain, in measured directions: everything grows and nothing is held; with a cortex as
    # stiff as the core, growth makes the folds rather than buckling (docs/science.md)
    "measured": {
        "step_s": 86_400.0,
        "stress_memory_gw": 0.0,
        "shear_modulus_cortex_pa": 300.0,
        "shear_modulus_core_pa": 300.0,
        "support": "free",
        "contact": {"kind": "global"},
        "no_growth": {"kind": "none"},
        "follow": {
            "area_cm2": "measured",
            "volume_ml": "measured",
            "regional": 1.0,
            "directional": 1.0,
            "smoothing_mm": 3.0,
        },
    },
}
