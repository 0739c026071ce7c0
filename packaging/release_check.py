"""All that a release must hold, from the packages to the notebooks; what does not hold ends it.

Run: make release-check, or python packaging/release_check.py [STEP ...]. It leaves dist/ with what would be uploaded,
and with the recipe for conda-forge.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import tomllib
import urllib.error
import urllib.request
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
DIST = ROOT / "dist"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SUPPORTED = [row.split(" :: ")[-1] for row in PROJECT["classifiers"] if re.search(r"Python :: 3\.\d+$", row)]
SCHEMAS = {
    "github-workflows": ".github/workflows/*.yml",
    "github-issue-forms": ".github/ISSUE_TEMPLATE/[!c]*.yml",
    "github-issue-config": ".github/ISSUE_TEMPLATE/config.yml",
    "citation-file-format": "CITATION.cff",
    "readthedocs": ".readthedocs.yaml",
}
LEAST_RATING = 8  # of pyroma's 10: for the rest it asks for an address of electronic mail, of which there is none
SERVED = 60.0  # seconds that the viewer may take to answer
ANSWERED = 20.0  # seconds that a server may take to answer


def tell(what: str) -> None:
    """Say what begins."""
    print(f"== {what}", flush=True)


def run(*words: object, cwd: Path = ROOT, **environment: str) -> str:
    """Run a program and return what it printed; SystemExit with all of it where it fails."""
    env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")} | environment
    done = subprocess.run([*map(str, words)], cwd=cwd, env=env, text=True, stdout=-1, stderr=subprocess.STDOUT)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}\n{done.stdout}\nfailed: exit code {done.returncode}")
    return done.stdout


def tool(*words: object) -> str:
    """Run a module of the environment that this runs in."""
    return run(sys.executable, "-m", *words)


def find(pattern: str, text: str) -> str:
    """Return what the first group of a pattern is in a text."""
    found = re.search(pattern, text, re.M)
    if not found:
        raise SystemExit(f"{pattern} is not in:\n{text}")
    return found[1]


def version() -> str:
    """Version of the sources."""
    return find(r'^__version__ = "(.+)"$', (ROOT / "src/edgel/__init__.py").read_text())


def wheel() -> Path:
    """The wheel that was built."""
    return DIST / f"edgel-{version()}-py3-none-any.whl"


def agree() -> None:
    """Versions, addresses and dependencies are the same wherever they stand."""
    tell("versions, addresses and dependencies agree")
    recipe_text = (ROOT / "packaging/recipe.yaml").read_text()
    recipe = yaml.safe_load(recipe_text)
    said = {
        "CITATION.cff": yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"],
        "packaging/recipe.yaml": recipe["context"]["version"],
        "CHANGELOG.md": find(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text()),
    }
    wrong = [f"{name} says {number}" for name, number in said.items() if number != version()]
    known = set(PROJECT["urls"].values())
    repository, pages = PROJECT["urls"]["Repository"], PROJECT["urls"]["Documentation"]
    for path in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CITATION.cff", "mkdocs.yml", "packaging/recipe.yaml"):
        urls = re.findall(r"https://(?:github\.com|[\w.]*readthedocs\.io)/[^\s)\]>\"`]*", (ROOT / path).read_text())
        others = [url for url in urls if url not in known and not url.startswith((repository, pages))]
        wrong += [f"{path} has another address: {url}" for url in others]
    needed = {find(r"^([\w.-]+)", row): row for row in PROJECT["dependencies"]}
    listed = {row.split()[0]: row for row in recipe["requirements"]["run"]}
    for name, row in needed.items():
        least = row.split(">=")[1]
        if listed.get(name, "").split(">=")[-1] != least:
            wrong.append(f"packaging/recipe.yaml: {name} is not >={least}")
    if wrong:
        raise SystemExit("\n".join(wrong))
    for schema, pattern in SCHEMAS.items():
        tool("check_jsonschema", "--builtin-schema", f"vendor.{schema}", *sorted(ROOT.glob(pattern)))


def links() -> None:
    """Links of the pages to other places: one that leads nowhere ends it, those that nobody answered for are named."""
    tell("links to other places")
    found: dict[str, Path] = {}
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")):
        for url in re.findall(r"https://[^\s)\]>\"'`]+", path.read_text()):
            found.setdefault(url.rstrip(".,;"), path)
    # Of the project's own some only exist once it is released.
    others = [url for url in found if not url.startswith(tuple(PROJECT["urls"].values()))]
    with ThreadPoolExecutor(8) as pool:
        answers = dict(zip(others, pool.map(status, others), strict=True))
    gone = [f"{found[url].relative_to(ROOT)}: {url} is gone" for url, code in answers.items() if code in (404, 410)]
    if gone:
        raise SystemExit("\n".join(gone))
    unknown = [f"   {url}: {code or 'no answer'}" for url, code in answers.items() if code != 200]
    print(f"   {len(others) - len(unknown)} of {len(others)} lead somewhere; without an answer, so not checked:")
    print(*unknown or ["   none"], sep="\n")


def status(url: str) -> int | None:
    """What the server answers to a request for a page, None if nothing does."""
    request = urllib.request.Request(url, headers={"User-Agent": "Mozilla/5.0 (edgel, release_check.py)"})
    try:
        with urllib.request.urlopen(request, timeout=ANSWERED) as page:
            return page.status
    except urllib.error.HTTPError as error:
        return error.code
    except OSError:
        return None


def packages() -> None:
    """Wheel and sdist, built from nothing and looked at by four programs."""
    bring_forms()
    tell("wheel and sdist")
    shutil.rmtree(DIST, ignore_errors=True)
    tool("build", "--outdir", DIST, ROOT)
    sdist = DIST / f"edgel-{version()}.tar.gz"
    tool("twine", "check", "--strict", wheel(), sdist)
    tool("check_wheel_contents", wheel())
    run(Path(sys.executable).with_name("pyroma"), "-n", LEAST_RATING, sdist)
    checksum = hashlib.sha256(sdist.read_bytes()).hexdigest()
    recipe = (ROOT / "packaging/recipe.yaml").read_text()
    (DIST / "recipe.yaml").write_text(recipe.replace("sha256: SHA256", f"sha256: {checksum}"))


def bring_forms() -> None:
    """Have the wheel bring along the forms of kernels, for every supported Python that is here, on this platform."""
    for path in (ROOT / "src/edgel/_kernels").glob("forms-*.zip"):
        path.unlink()
    for number, python in interpreters().items():
        tell(f"Python {number}: forms of kernels")
        with tempfile.TemporaryDirectory() as folder:
            programs = environment(Path(folder), python, *PROJECT["dependencies"])
            print(run(programs / "python", ROOT / "packaging/kernel_forms.py", PYTHONPATH=str(ROOT / "src")), end="")


def interpreters() -> dict[str, str]:
    """Every supported Python that is here: version to program."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    ask = "import sys; print(*sys.version_info[:2], sep='.')"
    found = {}
    for number in SUPPORTED:
        for program in (shutil.which(f"python{number}"), *versions.glob(f"{number}.*/bin/python")):
            # What pyenv leaves on the path for a version that is not chosen fails.
            if program and subprocess.run([program, "-c", ask], capture_output=True, text=True).stdout == f"{number}\n":
                found[number] = str(program)
        if number not in found:
            print(f"   Python {number} is not here")
    if not found:
        raise SystemExit("no supported Python was found")
    return found


def bare() -> None:
    """From an empty folder with Python only, as the first page says: install, demo, detect, view."""
    for number, python in interpreters().items():
        tell(f"Python {number}: a bare environment")
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            programs = environment(folder, python, f"{wheel()}[plot,view]")
            run(programs / "edgel", "demo", "-o", "demo", cwd=folder)
            run(programs / "edgel", "detect", "demo/tee.ply", "-o", "edges.ply", cwd=folder)
            real = ROOT / "benchmarks/real/vlp16_pose09.npz"
            run(programs / "edgel", "detect", real, "-o", "real.ply", cwd=folder)
            run(programs / "edgel", "render", "edges.ply", "-o", "picture.png", cwd=folder)
            serve(programs / "edgel", folder)


def environment(folder: Path, python: str, *wanted: str) -> Path:
    """Make a virtual environment with some packages, and return where its programs lie."""
    run(python, "-m", "venv", folder / "venv")
    programs = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
    run(programs / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted)
    return programs


def serve(program: Path, folder: Path) -> None:
    """Start the viewer and get its page."""
    words = [program, "view", "demo/tee.ply", "--no-browser"]
    with subprocess.Popen(words, cwd=folder, text=True, stdout=-1, stderr=subprocess.STDOUT) as viewer:
        assert viewer.stdout
        late = threading.Timer(SERVED, viewer.terminate)  # which ends its output, and the wait for a line of it
        late.start()
        try:
            for line in viewer.stdout:
                if found := re.search(r"http://\S+/", line):
                    with urllib.request.urlopen(found[0], timeout=SERVED) as page:
                        assert page.status == 200
                    return
            raise SystemExit("the viewer gave no address")
        finally:
            late.cancel()
            viewer.terminate()


def pages() -> None:
    """Every block of the documentation, with the wheel and everything that the pages install."""
    tell("every page, with the wheel")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        number, python = next(iter(interpreters().items()))
        programs = environment(folder, python, f"{wheel()}[export,lines,plot,ros,view]", "pytest")
        tell(f"Python {number}: blocks of README.md and docs/")
        run_pages(programs, folder)


def run_pages(programs: Path, folder: Path, *chosen: str) -> None:
    """Run the tests of the pages by the edgel that is installed, not by the sources."""
    words = ["-q", "--noconftest", "-c", os.devnull, f"--rootdir={ROOT}", "-p", "no:cacheprovider", *chosen]
    run(programs / "python", "-P", "-m", "pytest", *words, ROOT / "tests/test_docs.py", cwd=folder, MPLBACKEND="Agg")


def oldest() -> None:
    """The oldest versions that pyproject.toml allows, on the oldest Python."""
    tell("the oldest dependencies")
    found = interpreters()
    number = min(found, key=lambda number: int(number.split(".")[1]))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(found[number], "-m", "venv", folder / "venv")
        programs = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        # Of the sources: of a wheel only the wheel itself would be direct.
        lowest = (
            "--quiet",
            "--resolution",
            "lowest-direct",
            "--python-version",
            number,
            "--extra",
            "view",
            "--extra",
            "plot",
        )
        tool("uv", "pip", "compile", *lowest, "--output-file", folder / "lowest.txt", ROOT / "pyproject.toml")
        python = ("--python", programs / "python")
        tool("uv", "pip", "install", "--quiet", *python, "--requirements", folder / "lowest.txt", "pytest>=8.2")
        tool("uv", "pip", "install", "--quiet", *python, "--no-deps", wheel())
        print(tool("uv", "pip", "list", *python))
        run_pages(programs, folder, "-k", "README or start or research or depth-frames")


def notebooks() -> None:
    """The notebooks, from the first cell to the last."""
    import nbclient  # pyright: ignore[reportMissingImports]
    import nbformat  # pyright: ignore[reportMissingImports]

    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        tell(f"notebooks/{path.name}")
        with tempfile.TemporaryDirectory() as folder:
            notebook = nbformat.read(path, as_version=4)
            nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": folder}}).execute()


STEPS: dict[str, Callable[[], None]] = {
    "agree": agree,
    "links": links,
    "packages": packages,
    "bare": bare,
    "pages": pages,
    "oldest": oldest,
    "notebooks": notebooks,
}


def main(words: Sequence[str] | None = None) -> None:
    """Run the steps asked for, or all."""
    parser = argparse.ArgumentParser(description="All that a release must hold.")
    parser.add_argument("steps", nargs="*", help=f"some of: {', '.join(STEPS)} (default: all)")
    chosen = parser.parse_args(words).steps
    for step in chosen or STEPS:
        STEPS[step]()
    tell(f"held: {', '.join(chosen)}" if chosen else f"edgel {version()} may be released: {DIST}")


if __name__ == "__main__":
    main()
