"""Sessions of the viewer without a browser, and a file to open."""

import pytest
from hall import hall

import edgel
from edgel._viewer.session import Session


@pytest.fixture
def open_session():
    sessions = []

    def start(paths, **options):
        sessions.append(Session(paths, **options))
        sessions[-1].start()
        return sessions[-1]

    yield start
    for session in sessions:
        session.close()


@pytest.fixture
def hall_file(tmp_path):
    path = tmp_path / "a hall.ply"
    edgel.write(path, edgel.Cloud(hall()))
    return str(path)
