"""``--where``: which points a condition holds for, what is no condition, and that nothing in it is ever run."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import edgel
from edgel import Cloud, io
from edgel._cli import app
from edgel._cli.errors import ExitCode, Failure
from edgel._cli.where import Where

CLOUD = Cloud(
    np.arange(12.0).reshape(4, 3),
    {
        "classification": np.array([2, 6, 6, 9], np.uint8),
        "X [mm]": np.arange(4.0),
        "class": np.array([1, 1, 2, 2], np.uint16),
        "normal": np.arange(12).reshape(4, 3),
        "name": np.array(["a", "wall", "b's", "é"]),
        "code": np.array([b"a", b"b", b"c", b"d"]),
        "mixed": np.array(["a", None, b"b", 3], object),
        "flag": np.array([1, 0, 1, 0], bool),
        "heat": np.array([0.1, 0.2, 0.3, np.nan], np.float32),
        "when": np.array([1, 2, 3, 4], "datetime64[s]"),
        "stamp": np.array([2**63, 2**63 + 1, 0, 1], np.uint64),
    },
)


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("classification == 6", [1, 2]),
        ("classification != 6", [0, 3]),
        ("classification in (6, 9)", [1, 2, 3]),
        ("classification not in [6]", [0, 3]),
        ("classification == 300", []),
        ("classification > -1", [0, 1, 2, 3]),
        ("0 < z < 9 and not flag", [1]),
        ("x == 0 or y == 4 or z == 8", [0, 1, 2]),
        ("not (x < 5 or name == 'é')", [2]),
        ("x < 5 and y < 3 or z > 9", [0, 3]),
        ("`X [mm]` >= 2", [2, 3]),
        ("`class` == 2 and flag", [2]),
        ("normal[2] == 5", [1]),
        ('name == "b\'s"', [2]),
        ("name in ('a', 'é')", [0, 3]),
        ("name == '`X`'", []),
        ("code == 'b'", [1]),
        ("mixed == 'b'", [2]),
        ("flag == True", [0, 2]),
        ("heat == 0.1", [0]),
        ("heat != 0.1", [1, 2, 3]),
        ("stamp == 9223372036854775809", [1]),
        ("x == normal[0]", [0, 1, 2, 3]),
        (" x >= 3\n and x <= 6 ", [1, 2]),
        ("x == -0 or z == 1.1e1", [0, 3]),
    ],
)
def test_points_that_a_condition_holds_for(text, rows):
    assert np.flatnonzero(Where(text).mask(CLOUD)).tolist() == rows


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("classification = 6", "== compares"),
        ("class == 6", "stands in `backticks`"),
        ("classification & 6", "write and, or instead of &, |"),
        ("(x == 1) & (y == 2)", "write and, or instead of &, |"),
        ("__import__('os').system('true')", "is no condition"),
        ("x.__class__ == 1", "neither a column nor a number nor a text"),
        ("open('a') == 1", "neither a column nor a number nor a text"),
        ("[i for i in x] == 1", "neither a column"),
        ("(y := 1) == x", "neither a column"),
        ("f'{x}' == name", "neither a column"),
        ("lambda: 1", "is no condition"),
        ("x if y else z", "is no condition"),
        ("x + 1 == 2", "neither a column"),
        ("x is 1", "is no comparison"),
        ("x in y", "in needs a list of constants"),
        ("x in (y, 1)", "is neither a column"),
        ("1 == 1", "names no column"),
        ("1", "is no condition"),
        ("x == 1; y == 2", "cannot be read"),
        ("", "cannot be read"),
        ("x == ", "cannot be read"),
        ("(" * 1000, "cannot be read"),
        ("x == 1e999", "neither a column"),
        ("x == " + "9" * 5000, "at most 2,000 are read"),
        ("x == 1j", "neither a column"),
        ("x == None", "neither a column"),
    ],
)
def test_what_is_no_condition(text, message):
    with pytest.raises(Failure) as caught:
        Where(text)
    assert caught.value.code == ExitCode.USAGE
    assert str(caught.value).startswith("--where: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Classification == 6", "no column 'Classification', perhaps classification; there are x, y, z, class"),
        ("nothing == 6", "no column 'nothing'; there are x, y, z, classification, X [mm]"),
        ("normal == 3", "normal has 3 values a point; choose one, from normal[0] to normal[2]"),
        ("normal[7] == 3", "choose one, from normal[0] to normal[2]"),
        ("x[0] == 1", "x has one value a point"),
        ("name == 6", "name is text and 6 is a number"),
        ("classification == 'wall'", "'wall' is text and classification is a number"),
        ("classification", "classification is a number, no condition; compare it, as in: classification != 0"),
        ("when == 1", "holds neither numbers nor texts"),
    ],
)
def test_what_does_not_fit_the_cloud(text, message):
    with pytest.raises(Failure, match="--where") as caught:
        Where(text).mask(CLOUD)
    assert caught.value.code == ExitCode.USAGE
    assert message in str(caught.value)


COMPARED = st.builds(
    "{} {} {}".format,
    st.sampled_from(["x", "heat", "label"]),
    st.sampled_from(["==", "!=", "<", "<=", ">", ">="]),
    st.integers(-3, 3),
)
CONDITIONS = st.recursive(
    COMPARED,
    lambda inner: (
        st.builds("({} {} {})".format, inner, st.sampled_from(["and", "or"]), inner)
        | st.builds("not ({})".format, inner)
    ),
    max_leaves=6,
)


@given(CONDITIONS)
def test_conditions_mean_what_python_means(text):
    rows = np.array([[x, heat, label] for x in (-2, 0, 3) for heat in (-1, 2) for label in (0, 1)])
    cloud = Cloud(rows.astype(float), {"heat": rows[:, 1], "label": rows[:, 2].astype(np.int8)})
    expected = [eval(text, {}, dict(zip(("x", "heat", "label"), row, strict=True))) for row in rows.tolist()]
    assert Where(text).mask(cloud).tolist() == expected


@given(st.text(st.sampled_from("xyz01.=<>!()[]'\"`\\ andornti,&|:*-~@\n{}"), max_size=40) | st.text(max_size=40))
def test_any_text_is_a_condition_or_refused(text):
    try:
        found = Where(text).mask(CLOUD)
    except Failure as failure:
        found = failure
    if isinstance(found, Failure):
        assert (found.code, str(found).isprintable()) == (ExitCode.USAGE, True)
    else:
        assert (found.dtype, found.shape) == (np.dtype(bool), (4,))


def run(*words):
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    """A roof of 1,600 points, class 6, on a wide floor below, class 2, its rows shuffled."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    top, floor = np.c_[x, y, 30 - abs(x - 20)], np.c_[2 * x - 20, 2 * y - 20, 0 * x]
    order = np.random.default_rng(0).permutation(3200)
    labels = np.repeat(np.array([6, 2], np.uint8), 1600)[order]
    path = tmp_path_factory.mktemp("where") / "roof.ply"
    io.write(path, Cloud(np.r_[top, floor][order], {"classification": labels, "row": np.arange(3200)}))
    return path


SIX = ("--where", "classification == 6")


def test_edges_are_those_of_the_points_alone(roof, tmp_path):
    cloud = io.read(roof)
    alone = cloud.take(cloud.attributes["classification"] == 6)
    expected = edgel.detect(alone)
    result = run("detect", roof, "-o", tmp_path / "edges.npz", *SIX, "--json")
    written = io.read(tmp_path / "edges.npz")
    assert written.attributes["row"].tolist() == alone.attributes["row"][expected.index].tolist()
    np.testing.assert_array_equal(written.attributes["edge_kind"], expected.kind)
    told = json.loads(result.stdout)
    assert (told["points"], told["not_selected"], told["not_finite"]) == (3200, 1600, 0)
    assert told["share"] == len(expected) / 1600
    assert "1,600  by --where" in run("detect", roof, *SIX).stderr


def test_with_all_every_point_is_kept(roof, tmp_path):
    copy = tmp_path / "copy.ply"
    copy.write_bytes(roof.read_bytes())
    assert run("detect", copy, "-o", copy, "--all", *SIX).exit_code == 0
    before, after = io.read(roof), io.read(copy)
    np.testing.assert_array_equal(after.xyz, before.xyz)
    edge = after.attributes["edge_kind"] > 0
    assert edge.any()
    assert (after.attributes["classification"][edge] == 6).all()


def test_normals_at_the_points_alone(roof, tmp_path):
    result = run("normals", roof, "-o", tmp_path / "normals.npz", *SIX, "--json")
    written = io.read(tmp_path / "normals.npz")
    six = written.attributes["classification"] == 6
    np.testing.assert_array_equal(np.isfinite(written.attributes["nx"]), six)
    expected = edgel.estimate_normals(io.read(roof).take(six)).normals
    np.testing.assert_allclose(np.c_[[written.attributes[f"n{axis}"][six] for axis in "xyz"]].T, expected, atol=1e-6)
    assert json.loads(result.stdout)["not_selected"] == 1600


def test_convert_and_info_take_the_points_alone(roof, tmp_path):
    assert run("convert", roof, tmp_path / "six.npz", *SIX).exit_code == 0
    six = io.read(tmp_path / "six.npz")
    assert set(six.attributes["classification"]) == {6}
    assert len(six) == 1600
    assert json.loads(run("info", roof, "--json", *SIX).stdout)["points"] == 1600
    before = roof.read_bytes()
    result = run("convert", roof, roof, *SIX)
    assert (result.exit_code, "alone would replace it" in result.stderr) == (2, True)
    assert roof.read_bytes() == before


def test_a_grid_stays_one_for_detect_and_becomes_a_list_for_convert(tmp_path):
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    cloud = Cloud(np.stack([x, y, -abs(x - 20)], axis=-1), {"row": np.repeat(np.arange(30), 40)})
    io.write(tmp_path / "grid.npz", cloud)
    told = json.loads(run("detect", tmp_path / "grid.npz", "--where", "row >= 10", "--json").stdout)
    assert (told["method"], told["not_selected"]) == ("organized", 400)
    result = run("convert", tmp_path / "grid.npz", tmp_path / "part.ply", "--where", "row >= 10")
    assert "organized rows and columns: left out" in result.stderr
    assert len(io.read(tmp_path / "part.ply")) == 800


def test_render_shows_the_points_alone(roof, tmp_path):
    result = run("render", roof, "-o", tmp_path / "roof.png", "--size", "320x240", *SIX)
    assert result.exit_code == 0
    assert "by --where" in result.stderr


@pytest.mark.parametrize(
    "command", [["info"], ["detect"], ["normals", "-o", "a.ply"], ["convert"], ["render", "-o", "a.png"]]
)
def test_columns_that_are_not_there_and_points_that_are_not_there(roof, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = ["a.ply"] if command == ["convert"] else []
    result = run(*command, roof, *out, "--where", "klass == 6")
    assert result.exit_code == 2
    assert "there are x, y, z, classification, row" in result.stderr
    result = run(*command, roof, *out, "--where", "classification == 7")
    assert result.exit_code == 4
    known = "classification goes from 2 to 6"
    assert result.stderr == f"edgel: --where: of 3,200 points none has classification == 7; {known}\n"
    missing = run(*command, "missing.ply", *out, "--where", "import os")
    assert (missing.exit_code, "cannot be read" in missing.stderr) == (2, True)  # before any file is opened
    assert list(tmp_path.iterdir()) == []
