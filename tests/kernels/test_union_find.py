"""Union-find: which things pairs join."""

from hypothesis import given
from hypothesis import strategies as st
from numpy import array, int64

from edgel._kernels.union_find import join

PAIRS = st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=30)


@given(PAIRS)
def test_sets_are_those_that_pairs_make(pairs):
    sets = [{member} for member in range(20)]
    for a, b in pairs:
        one, other = (next(s for s in sets if member in s) for member in (a, b))
        if one is not other:
            sets = [s for s in sets if s is not one and s is not other] + [one | other]
    ends = array(pairs, int64).reshape(-1, 2)
    found = join(20, ends[:, 0], ends[:, 1])
    assert {frozenset(s) for s in sets} == {
        frozenset(member for member in range(20) if found[member] == number) for number in set(found.tolist())
    }
    first = [min(member for member in range(20) if found[member] == number) for number in range(found.max() + 1)]
    assert first == sorted(first)  # numbered by their first members
