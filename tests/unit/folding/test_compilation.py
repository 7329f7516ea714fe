r"""Where code is compiled, and for which processors.

The tests of our C code under the address and undefined-behaviour sanitizers of gcc:

    ./run env XDG_CACHE_HOME=/tmp/sanitized PYTHONMALLOC=malloc \
        ASAN_OPTIONS=detect_leaks=0 \
        LD_PRELOAD="$(./run gcc -print-file-name=libasan.so) \
            $(./run gcc -print-file-name=libubsan.so)" python -c \
    'import sys, pytest; from gyriflow.folding import compilation; (
        compilation.COMPILER_ARGUMENTS.extend(["-g", "-fsanitize=address,undefined"]),
        sys.exit(pytest.main(["-q", "-n", "0", "-m", "not slow", *sys.argv[1:]])),
    )' tests/mpi/linear_elements_cases.py tests/mpi/linear_solver_cases.py \
        tests/unit/folding/test_compilation.py tests/unit/folding/test_layers.py
"""

from types import SimpleNamespace

import cffi
import numpy as np
import pytest
from facts import Facts

from gyriflow.folding.compilation import form_compiler, pointer
from gyriflow.folding.products import PartMotions, multiply_blocks


def test_ranks_on_different_processors_share_code_that_all_can_execute(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folders = {}
    for processors in (("old", "old"), ("new",), ("old", "new"), ("new", "old")):
        ranks = SimpleNamespace(
            rank=0, allgather=lambda _, found=processors: found, barrier=lambda: None
        )
        with form_compiler(ranks) as options:
            folders[processors] = options["cache_dir"]
            assert ("-march=native" in options["cffi_extra_compile_args"]) == (
                len(set(processors)) == 1
            )
    assert folders["old", "new"] == folders["new", "old"]
    assert len(set(folders.values())) == 3


NUMBERS = np.arange(6.0).reshape(2, 3)
FIXED = np.arange(6.0)
FIXED.setflags(write=False)


@pytest.mark.parametrize(
    ("numbers", "size", "is_written", "facts"),
    [
        (NUMBERS.astype(np.float32), 6, False, ["float64", "float32"]),
        (NUMBERS.astype(">f8"), 6, False, ["float64", ">f8"]),
        (NUMBERS, 7, False, [7, "(2, 3)"]),
        (NUMBERS.T, 6, False, ["contiguous"]),
        (FIXED, 6, True, ["read-only"]),
    ],
)
def test_c_code_gets_arrays_of_its_type_and_size_only(numbers, size, is_written, facts):
    interface = cffi.FFI()
    for whole in (NUMBERS, FIXED):
        found = pointer(interface, whole, np.float64, 6)
        assert interface.cast("double *", found)[4] == 4.0
    with pytest.raises((TypeError, ValueError), check=Facts(*facts)):
        pointer(interface, numbers, np.float64, size, is_written=is_written)


def test_products_refuse_arrays_that_c_code_would_misread():
    blocks, x, y = np.ones((4, 3, 3), np.float32), np.ones(12), np.zeros(12)
    multiply_blocks(blocks, x, y)
    assert y == pytest.approx(3.0)
    part, arms = np.array([0, 0, 1, 1]), np.ones((4, 3), np.float32)
    motions = PartMotions(part, arms)
    assert motions.restrict(x, 2)[:3] == pytest.approx(2.0)
    single = x.astype(np.float32)
    for function, *misread in (
        (multiply_blocks, blocks.astype(float), x, y),
        (multiply_blocks, blocks, single, y),
        (multiply_blocks, blocks, x, y.astype(int)),
        (motions.restrict, single, 2),
        (PartMotions(part, arms.astype(float)).restrict, x, 2),
    ):
        with pytest.raises(TypeError):
            function(*misread)
    for function, *short in (
        (multiply_blocks, blocks, x[:9], y),
        (multiply_blocks, blocks, x, y[:9]),
        (motions.add, x, y[:9]),
    ):
        with pytest.raises(ValueError, check=Facts(12, "(9,)")):
            function(*short)
