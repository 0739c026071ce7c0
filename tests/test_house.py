"""The house itself: imports run one way, nothing optional is loaded, files stay small, examples in docstrings hold."""

import ast
import doctest
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import edgel

ROOT = Path(edgel.__file__).parent
FLOORS = [
    {"cloud", "_objects", "_intrinsics", "_depth", "_columns", "_kernels", "_stages"},
    {"edges", "_kinds", "_faces", "_neighbors", "io"},
    {"_scale", "_surface", "_range_image", "_color", "paper", "plot", "synth", "metrics"},
    {"_labels", "_sides", "_detect", "_many", "_probabilities", "export"},
    {"curves", "matching", "tiled"},
    {"_report"},
    {"_demo", "_viewer"},
    {"_cli"},
]
"""A file imports from rooms of its own floor and those above it in this list, never from below."""
WAYS_TO_LOOK = {"_surface", "_range_image", "_color"}
"""They never import each other."""
LATE = ("edges", "export")
"""The one import against the rule, inside functions: `edges.to_open3d()` and its like stay methods because that is what
users try first, and `export` has to know `edges`."""

FILES = sorted(ROOT.rglob("*.py"))
MOST_LINES, MOST_STATEMENT_LINES, MOST_PARAMETERS = 300, 60, 10


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")


def room_of(module: str) -> str:
    return (module.split(".") + ["__init__"])[1]


def floor_of(module: str) -> int:
    room = room_of(module)
    if room in ("__init__", "__main__"):  # the names users import, and the door of the command line
        return len(FLOORS)
    (floor,) = (number for number, rooms in enumerate(FLOORS) if room in rooms)
    return floor


MODULES = {module_of(path): path for path in FILES}


def imports_of(module: str) -> set[str]:
    """Modules of edgel that a file names, at its top or inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "edgel":
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "edgel"}
    return found - {module}


IMPORTS = {module: imports_of(module) for module in MODULES}


def public_of(module: str) -> set[str]:
    """What `import edgel` itself stands for, where a room imports it whole: every room that it hands on."""
    return IMPORTS["edgel"] if module == "edgel" else {module}


@pytest.mark.parametrize("module", MODULES)
def test_imports_run_one_way(module):
    for other in sorted(IMPORTS[module]):
        if (room_of(module), room_of(other)) == LATE:
            continue
        for real in public_of(other):
            assert floor_of(real) <= floor_of(module), f"{module} imports {real}, which lies above it"
            ways = {room_of(module), room_of(real)} & WAYS_TO_LOOK
            assert len(ways) < 2, f"{module} imports {real}: two ways to look at a cloud"


def test_no_imports_run_in_a_circle():
    """File by file, late imports included, but for the one that is named."""
    done: set[str] = set()

    def visit(module: str, above: tuple[str, ...]) -> None:
        assert module not in above, " -> ".join([*above[above.index(module) :], module])
        if module in done:
            return
        for other in IMPORTS[module]:
            if (room_of(module), room_of(other)) != LATE:
                visit(other, (*above, module))
        done.add(module)

    for module in MODULES:
        visit(module, ())


def test_the_late_import_is_late():
    top = ast.parse(MODULES["edgel.edges"].read_text()).body
    assert not any(isinstance(node, ast.ImportFrom) and "export" in ast.dump(node) for node in top)
    assert f"edgel.{LATE[1]}" in IMPORTS[f"edgel.{LATE[0]}"]


@pytest.mark.parametrize("module", MODULES)
def test_files_and_functions_stay_small(module):
    text = MODULES[module].read_text()
    assert len(text.splitlines()) <= MOST_LINES
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.FunctionDef) or is_kernel(node):
            continue
        body = node.body[1:] if ast.get_docstring(node) else node.body
        length = body[-1].end_lineno - body[0].lineno + 1 if body else 0  # pyright: ignore[reportOptionalOperand]
        assert length <= MOST_STATEMENT_LINES, f"{node.name}: {length} lines"
        arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
        own = [argument for argument in arguments if argument.arg not in ("self", "cls")]
        if not takes_options(module, node):
            assert len(own) <= MOST_PARAMETERS, f"{node.name}: {len(own)} parameters"


def is_kernel(node: ast.FunctionDef) -> bool:
    kinds = ("kernel", "routine", "summing_routine", "part")
    return any(isinstance(name, ast.Name) and name.id in kinds for name in node.decorator_list)


def takes_options(module: str, node: ast.FunctionDef) -> bool:
    """Whether a function is a list of options by its nature: a public one, or a command."""
    public = all(not part.startswith("_") for part in [*module.split("."), node.name])
    return public or room_of(module) == "_cli"


def test_import_is_light():
    heavy = ["matplotlib", "laspy", "typer", "rich", "PIL", "pye57", "viser", "ezdxf", "pyogrio", "shapely"]
    code = f"import sys, edgel; print(*(m for m in {heavy} if m in sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert loaded == []


@pytest.mark.parametrize("module", MODULES)
def test_examples_in_docstrings_hold(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # examples may write files
    if module == "edgel.__main__":
        pytest.skip("importing it runs the command line")
    if "e57" in module:
        pytest.importorskip("pye57", reason="the extra e57 is not installed")
    result = doctest.testmod(importlib.import_module(module))
    assert result.failed == 0


def test_public_names_are_documented():
    for name in edgel.__all__:
        assert getattr(edgel, name).__doc__, name
