"""The house itself: imports run one way, nothing optional is loaded, examples in docstrings hold."""

import ast
import doctest
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import edgel

ROOT = Path(edgel.__file__).parent
# Each room may import from rooms on lines above its own, and from its own line.
LAYERS = [
    {"parallel", "stages", "lanes"},
    {"cloud"},
    {"ranks"},
    {"kdtree"},
    {"blocks"},
    {"search"},
    {"neighbors", "planes"},
    {"normals", "canny", "chains"},
    {"project", "evidence", "edges", "raster", "color"},
    {"facets", "viewing"},
    {"outline"},
    {"metrics", "palette"},
    {"paper"},
    {"detect"},
    {"scale"},
]
ONLY_CLOUD = {"io"}  # formats know the cloud (and the threads) and nothing else
FREE = {
    "camera",
    "cli",
    "demo",
    "drawing",
    "export",
    "figures",
    "legend",
    "plot",
    "report",
    "scene",
    "surface",
    "synth",
    "view",
}  # on top: may use everything above
# What functions import when they are called, from rooms above: methods that hand edges on.
LATER = {"edges": {"export"}}


def _room(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def _imports(path: Path, *, later: bool) -> set[str]:
    """Rooms that a module imports at once, or later in its functions."""
    tree = ast.parse(path.read_text())
    inner = {
        node
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    found = set()
    for node in ast.walk(tree):
        if (node in inner) != later:
            continue
        if isinstance(node, ast.ImportFrom) and node.module:
            parts = node.module.split(".")
            if parts == ["edgel"]:
                found |= {alias.name for alias in node.names}
            elif parts[0] == "edgel":
                found.add(parts[1])
        elif isinstance(node, ast.Import):
            found |= {alias.name.split(".")[1] for alias in node.names if alias.name.startswith("edgel.")}
    return found


MODULES = sorted(path for path in ROOT.rglob("*.py") if path.name != "__init__.py" or path.parent != ROOT)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_one_way(path):
    room = _room(path)
    level = next((i for i, layer in enumerate(LAYERS) if room in layer), None)
    if room in ONLY_CLOUD:
        allowed = {"cloud", "parallel", room}
    elif level is not None:
        allowed = set().union(*LAYERS[: level + 1])
    else:
        assert room in FREE, f"{room}: say in LAYERS or FREE where this room belongs"
        return
    assert _imports(path, later=False) <= allowed
    assert _imports(path, later=True) <= allowed | LATER.get(room, set())


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_stay_small(path):
    assert len(path.read_text().splitlines()) <= 320


def test_import_is_light():
    heavy = ["matplotlib", "laspy", "typer", "rich", "PIL", "pye57", "viser"]
    code = f"import sys, edgel; print(*(m for m in {heavy} if m in sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert loaded == []


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_examples_in_docstrings_hold(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # examples may write files
    name = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")
    if name.endswith("__main__") or "e57" in name:
        pytest.skip("not importable here")
    result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0


def test_public_names_are_documented():
    for name in edgel.__all__:
        assert getattr(edgel, name).__doc__, name
