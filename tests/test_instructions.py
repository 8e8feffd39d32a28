"""A cycle takes as many instructions as when the reference was made: counted, so that the answer is the same on a busy
machine. `python bench/run.py --instructions` makes the reference anew after a change that is meant to change it."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
import run as bench

CLOSE = 0.03
FAR = 0.5  # another compiler or instruction set: only what would be wrong with any of them is seen


@pytest.mark.instructions
def test_a_cycle_takes_no_more_instructions_than_the_reference():
    expected, made_with = bench.reference()
    counts = bench.instructions(bench.program())
    here = f"{bench.compiler()}; {bench.simd()}"
    bound = CLOSE if here == made_with else FAR
    if here != made_with:
        print(f"reference of {made_with}, this is {here}: compared within {FAR:.0%} only")
    wrong = [
        f"{case}: {count:.1f} instructions per slave and cycle, reference {expected[case]:.1f}"
        for case, count in counts.items()
        if count != pytest.approx(expected[case], rel=bound)
    ]
    assert not wrong, f"{wrong} (within {bound:.0%}); if that is meant: python bench/run.py --instructions"
