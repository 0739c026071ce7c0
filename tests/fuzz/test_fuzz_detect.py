"""What detection, the published method and normals do with the clouds that damaged files hold.

`make checked` runs this with every index of the kernels checked.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from fuzz_mutations import mutate
from fuzz_seeds import CAMERA, make_seeds

import edgel
from edgel import paper
from edgel.io import Intrinsics

READERS = ["ply", "pcd", "npy", "text", "tiff"]
INPUTS = 300  # of each reader; a third or less of them can be read
CAMERA_OF_SEEDS = Intrinsics(**json.loads(CAMERA))


@pytest.fixture(scope="module")
def seeds():
    return make_seeds(None)


def check(cloud):
    """All that computes on a cloud answers with rows of it, or refuses it with a documented error."""
    for compute in (edgel.detect, paper.detect, lambda c: paper.detect(c, width=40, height=30)):
        try:
            found = compute(cloud)
        except (TypeError, ValueError):
            continue
        assert ((found.index >= 0) & (found.index < len(cloud.xyz))).all()
        assert np.isfinite(found.strength).all()
    try:
        normals = edgel.estimate_normals(cloud)
    except (TypeError, ValueError):
        return
    assert normals.normals.shape == (len(cloud.xyz), 3)


@pytest.mark.parametrize("reader", READERS)
def test_clouds_of_damaged_files_are_answered_or_refused(reader, seeds, tmp_path):
    computed = 0
    for number in range(INPUTS):
        suffix, raw = mutate(reader, number, seeds[reader])
        path = Path(tmp_path, f"input{suffix}")
        path.write_bytes(raw)
        try:
            cloud = edgel.read(path, intrinsics=CAMERA_OF_SEEDS if suffix == ".tif" else None)
        except (OSError, ValueError):
            continue
        if len(cloud.xyz) <= 20_000:
            check(cloud)
            computed += 1
    assert computed > INPUTS / 10
