"""What comes from outside is shown printable and short, and is exact in JSON; streams may be closed or full."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel._cli import app
from edgel.io.errors import LONGEST, FormatError, describe_error, printable

RUNNER = CliRunner(env={"COLUMNS": "200"})
NASTY = {
    "escape": "a\x1b[31m\x1b]0;pwned\x07",
    "single-byte escape": "a\x9b31m",
    "right to left": "a\u202egnp.exe\u2066",
    "lines": "a\nedgel: all is well\r",
    "line separator": "a\u2028b\x85c",
    "delete": "a\x7f\x08",
    "markup": "a[red]b[/red][link=x]",
}
nasty = pytest.mark.parametrize("name", NASTY.values(), ids=NASTY)


def steers(text):
    """Whether a text does more than fill lines."""
    return any(not c.isprintable() for c in text.replace("\n", ""))


def cloud_with(name, path):
    if "\n" in name:
        pytest.skip("a PLY header has no field with a line break in its name")
    header = "ply\nformat ascii 1.0\nelement vertex 2\n" + "property float {}\n" * 4 + "end_header\n"
    path.write_bytes((header.format(*"xyz", name) + "1 2 3 4\n5 6 7 8\n").encode())
    return str(path)


@nasty
def test_names_of_files_and_fields(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    edgel.write("cloud.ply", edgel.Cloud(np.eye(3)))
    os.rename("cloud.ply", f"{name}.ply".replace("/", "-"))
    path = f"{name}.ply".replace("/", "-")
    for words in (["info", path], ["convert", path, f"{path}.xyz"], ["info", f"no{path}"], ["info", path, path]):
        result = RUNNER.invoke(app, words)
        assert not steers(result.output), words
        assert not any(line.startswith("edgel: all is well") for line in result.output.splitlines())
        if "[red]" in name and words[0] == "info" and len(words) == 2:
            assert "[red]b[-red][link=x]" in result.output
    facts = json.loads(RUNNER.invoke(app, ["info", path, "--json"]).stdout)
    assert facts["input"] == path


@pytest.mark.parametrize("name", [name for name in NASTY.values() if not set(" \n\r\x85\u2028") & set(name)])
def test_fields_are_exact_in_json(name, tmp_path):
    path = cloud_with(name, tmp_path / "a.ply")
    shown = RUNNER.invoke(app, ["info", path])
    assert shown.exit_code == 0
    assert not steers(shown.output)
    assert printable(name) in shown.output
    told = RUNNER.invoke(app, ["info", path, "--json"]).stdout
    assert not steers(told)
    assert json.loads(told)["fields"][0]["name"] == name


def test_the_case(shared_data):
    result = RUNNER.invoke(app, ["info", str(shared_data.parent / "cases" / "terminal_escape.ply")])
    assert result.exit_code == 0
    assert r"a\x1b[31m\x1b]0;pwned\x07" in result.output


@nasty
def test_errors_of_the_library(name, tmp_path):
    header = f"ply\nformat ascii 1.0\nelement {name} 1\nproperty float x\nend_header\n1\n"
    (tmp_path / "a.ply").write_bytes(header.encode())
    with pytest.raises(FormatError) as caught:
        edgel.read(tmp_path / "a.ply")
    assert str(caught.value).isprintable()
    with pytest.raises(FileNotFoundError) as missing:
        edgel.read(tmp_path / f"{name.replace('/', '-')}.ply")
    assert str(missing.value).isprintable()


def test_messages_are_short_and_say_what_is_left_out(tmp_path):
    elements = "".join(f"element e{i} 0\n" for i in range(50_000))
    (tmp_path / "a.ply").write_text(f"ply\nformat ascii 1.0\n{elements}end_header\n")
    with pytest.raises(FormatError, match=r"characters left out.*export the points as vertices") as caught:
        edgel.read(tmp_path / "a.ply")
    assert len(str(caught.value)) < LONGEST + 50
    result = RUNNER.invoke(app, ["info", str(tmp_path / "a.ply")])
    assert len(result.output) < LONGEST + 100
    assert len(RUNNER.invoke(app, ["info", "a", "b" * 100_000]).output) < 5000
    assert len(describe_error(ValueError("x" * 10**6))) < LONGEST + 50


def test_debug_shows_no_escapes_either(tmp_path):
    result = RUNNER.invoke(app, ["info", str(tmp_path / "\x1b[31m.ply"), "--debug"])
    assert "Traceback" in result.output
    assert not steers(result.output)


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes, /dev/full")
class TestStreams:
    def program(self, words, **options):
        command = [sys.executable, "-m", "edgel", *words]
        return subprocess.run(command, capture_output="stdout" not in options, timeout=120, check=False, **options)

    @pytest.fixture
    def scan(self, tmp_path):
        edgel.write(tmp_path / "a.ply", edgel.Cloud(np.eye(3)))
        return str(tmp_path / "a.ply")

    def test_names_that_are_no_text(self, scan, tmp_path):
        odd = os.fsencode(tmp_path) + b"/\xff\x9b.ply"
        os.rename(scan, odd)
        shown = self.program(["info", odd])
        assert shown.returncode == 0
        assert rb"\udcff\udc9b.ply" in shown.stdout
        told = self.program(["info", odd, "--json"])
        assert os.fsencode(json.loads(told.stdout)["input"]) == odd

    def test_a_terminal_of_few_characters(self, scan, tmp_path):
        os.rename(scan, tmp_path / "é.ply")
        shown = self.program(["info", tmp_path / "é.ply"], env={**os.environ, "PYTHONIOENCODING": "ascii"})
        assert shown.returncode == 0
        assert rb"\xe9.ply" in shown.stdout

    @pytest.mark.parametrize("words", [["info"], ["info", "--json"], ["--help"], ["--version"]], ids=" ".join)
    def test_stdout_that_is_full_or_closed(self, words, scan):
        words = [*words, scan] if "info" in words else words
        with open("/dev/full", "wb") as full:
            ended = self.program(words, stdout=full, stderr=subprocess.PIPE)
        assert ended.returncode == 5
        assert [b"no space left" in line for line in ended.stderr.splitlines() if b"kernels" not in line] == [True]
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "wb") as closed:
            ended = self.program(words, stdout=closed, stderr=subprocess.PIPE)
        assert ended.returncode != 0
        assert len([line for line in ended.stderr.splitlines() if b"kernels" not in line]) <= 1

    def test_streams_that_are_not_there(self, scan, tmp_path):
        def without(*numbers):
            return lambda: [os.close(number) for number in numbers]

        out = tmp_path / "b.ply"
        command = [sys.executable, "-m", "edgel", "convert", scan, out]
        for closed in ([1], [2], [1, 2], [0, 1, 2]):
            out.unlink(missing_ok=True)
            ended = subprocess.run(command, preexec_fn=without(*closed), timeout=120, check=False)
            assert ended.returncode == 0, closed
            assert len(edgel.read(out)) == 3
        ended = subprocess.run([*command[:4], scan, "-"], preexec_fn=without(1), timeout=120, check=False)
        assert ended.returncode == 5
