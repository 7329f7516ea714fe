"""A size that no cerebrum has is refused with the unit that was probably meant."""

import pytest
from facts import Facts

from gyriflow.anatomy.plausible import expected_volume_ml, require_plausible_size
from gyriflow.errors import InputError
from gyriflow.units import ML_PER_MM3


@pytest.mark.parametrize(
    # with the wrong unit of a header that may give the same size, if any
    ("factor", "units"),
    [
        (1e-3, ["metres", "header says micrometres"]),
        (1e3, ["micrometres", "header says metres"]),
        (0.1, ["centimetres"]),
    ],
)
def test_wrong_unit_is_named(factor, units):
    volume_mm3 = factor**3 * expected_volume_ml(24.0) / ML_PER_MM3
    with pytest.raises(InputError, check=Facts(24, "mL", *units)):
        require_plausible_size(volume_mm3, 24.0)
