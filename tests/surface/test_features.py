"""The layout of the features, the trees that hear of it, and that neither is mixed up."""

import naive
import numpy as np
import pytest

from edgel._surface import context, leaves, minimal_planes, plane_scales, sectors, two_planes
from edgel._surface.features import LEAF, NUM_EVIDENCE, NUM_SCREEN, POINT
from edgel._surface.forest import Forest, evaluate, load_forests, read_forests, write_forests


def test_trees_match_a_plain_walk():
    rng = np.random.default_rng(0)
    forest = Forest(
        roots=np.array([0, 5], np.int32),
        feature=np.array([1, 0, -1, -1, -1, 2, -1, -1], np.int16),
        threshold=np.array([0.5, 0.2, -1, 2, 0.3, 0.7, 1, -2], np.float32),
        right=np.array([4, 3, 0, 0, 0, 7, 0, 0], np.int32),
    )
    features = rng.random((200, 3)).astype(np.float32)
    expected = [naive.walk_trees(forest, row) for row in features]
    assert evaluate(forest, features) == pytest.approx(expected, abs=1e-12)


def test_the_package_has_trees_for_its_features():
    columns = {"leaf": len(LEAF), "screen": NUM_SCREEN, "crease": len(POINT), "outline": len(POINT)}
    columns |= {"first crease": NUM_EVIDENCE, "first outline": NUM_EVIDENCE}
    assert set(load_forests()) == set(columns)
    for name, forest in load_forests().items():
        assert 0 < forest.feature.max() < columns[name]
        assert (forest.right[forest.feature >= 0] > 0).all()


def test_weights_for_another_layout_are_refused(tmp_path):
    write_forests(str(tmp_path / "w.npz"), load_forests())
    assert set(read_forests(str(tmp_path / "w.npz"))) == set(load_forests())
    with np.load(tmp_path / "w.npz") as stored:
        arrays = dict(stored)
    for layouts in (arrays["layouts"][::-1], np.array(["leaf-1-00000000", arrays["layouts"][1]]), np.array([])):
        np.savez(tmp_path / "other.npz", **{**arrays, "layouts": layouts})  # pyright: ignore[reportArgumentType]
        with pytest.raises(ValueError, match=r"weights: .*train them again"):
            read_forests(str(tmp_path / "other.npz"))


def test_two_columns_cannot_be_swapped_unnoticed():
    """A swap in the layout changes its id; one in a kernel's constants no longer agrees with the names."""
    swapped = list(POINT.features)
    swapped[3], swapped[4] = swapped[4], swapped[3]
    assert type(POINT)(POINT.name, tuple(swapped)).id != POINT.id
    for module, names in (
        (plane_scales, plane_scales.OF_SCALE),
        (leaves, leaves.OF_GROUP),
        (sectors, sectors.FEATURES),
        (minimal_planes, minimal_planes.FEATURES),
        (two_planes, two_planes.FEATURES),
        (context, context.FEATURES),
    ):
        assert [getattr(module, name.upper()) for name in names] == list(range(len(names))), module.__name__
    first = len(leaves.GROUPS) * len(leaves.OF_GROUP)
    assert [getattr(leaves, name.upper()) - first for name in leaves.OF_LEAF] == list(range(len(leaves.OF_LEAF)))


def test_columns_are_named_once_and_blocks_are_whole():
    for layout in (LEAF, POINT):
        names = [feature.name for feature in layout.features]
        assert len(set(names)) == len(names)
        assert all(feature.meaning for feature in layout.features)
        assert [layout.column(name) for name in names] == list(range(len(layout)))
    blocks = (
        "plane",
        "nearest",
        "cloud",
        "two_planes",
        "minimal_planes",
        "sectors",
        "context_crease",
        "context_outline",
    )
    ends = [0]
    for name in blocks:
        block = POINT.block(name)
        assert block.start == ends[-1]
        ends.append(block.stop)
    assert ends[3] == NUM_SCREEN
    assert ends[6] == NUM_EVIDENCE
    assert ends[-1] == len(POINT)
