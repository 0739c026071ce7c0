"""The benchmark's scenes and parts: every level is there, a name is a scene, and parts of the CAD kernel are closed."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def benchmark_module(name):
    spec = importlib.util.spec_from_file_location(name, BENCHMARKS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def scenes(tmp_path):
    module = benchmark_module("scenes")
    vars(module)["CACHE"] = tmp_path
    return module


def test_the_benchmarks_scenes_hold_every_level(scenes):
    parts = [name.split("/") for name in scenes.TEST]
    assert len(set(scenes.TEST)) == len(scenes.TEST) >= 120
    assert not set(scenes.TEST) & set(scenes.TUNE)
    assert not {name.split("/")[0] for name in scenes.TUNE} & set(scenes.SHAPES)
    assert set(scenes.QUICK) <= set(scenes.TEST)
    assert set(scenes.PICTURES) <= set(scenes.TEST)
    assert not set(scenes.SENSED) & {*scenes.TEST, *scenes.TUNE}
    assert {name.split("/")[1] for name in scenes.SENSED} == {"kinect", "stereo", "spinning"}
    assert len(scenes.PICTURES) >= 5
    assert len({shape for shape, *_ in parts}) == 17
    for seen in (*scenes.VIEWS, *scenes.PATTERNS):
        assert {n for _, s, n, _ in parts if s == seen} == {"n0", "n0.1", "n0.3", "n1"}
        assert {o for _, s, _, o in parts if s == seen} == {"o0", "o1", "o5"}
    for shape in scenes.SHAPES:
        assert {n for s, _, n, _ in parts if s == shape} == {"n0", "n0.1", "n0.3", "n1"}
        assert {o for s, _, _, o in parts if s == shape} == {"o0", "o1", "o5"}


@pytest.mark.parametrize("name", ["frustum/spherical/n0.3/o5", "pyramid/graded2/n0.1/o1", "frustum/kinect/n0/o0"])
def test_a_name_is_a_scene(scenes, name):
    made, stored, again = scenes.make(name), scenes.load(name), scenes.load(name)
    for one in (stored, again):
        assert one.name == name
        assert one.spacing == made.spacing
        assert one.cloud.shape == made.cloud.shape
        assert one.cloud.xyz.tobytes() == made.cloud.xyz.tobytes()
        for field in ("point_kind", "normals", "noise_free", "outlier", "pose"):
            assert getattr(one, field).tobytes() == getattr(made, field).tobytes()
        for field in type(made.edges).__dataclass_fields__:
            assert getattr(one.edges, field).tobytes() == getattr(made.edges, field).tobytes()
    assert (stored.depth is None) == (made.depth is None)


@pytest.mark.parametrize(
    "name", ["frustum", "frustum/top/n0/o0", "cow/pinhole/n0/o0", "frustum/pinhole/nx/o0", "frustum/kinect/n1/o0"]
)
def test_other_names_are_refused(scenes, name):
    with pytest.raises(ValueError, match=re.escape("name:")):
        scenes.load(name)


def test_parts_of_the_cad_kernel_are_closed(tmp_path):
    pytest.importorskip("build123d")
    sys.modules.pop("parts", None)
    parts = benchmark_module("parts")
    vars(parts)["CACHE"] = tmp_path
    for name in ("bracket", "chamfered_block"):
        solid, exact = parts.part(name), parts.PARTS[name][0]()
        assert solid.boundaries == ()
        assert solid.area == pytest.approx(exact.area, rel=1e-3)
        assert solid.volume == pytest.approx(exact.volume, rel=1e-3)
        turns = np.degrees(np.concatenate([crease.dihedral for crease in solid.creases]))
        assert turns.max() == pytest.approx(90)
        assert turns.min() > 40


def test_a_part_says_how_to_install_its_maker(tmp_path):
    parts = benchmark_module("parts")
    vars(parts).update(CACHE=tmp_path, cad=None)
    with pytest.raises(ImportError, match="pip install"):
        parts.part("tee")
