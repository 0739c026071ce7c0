import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of the larger test data: EDGEL_DATA, or shared/data beside the repository."""
    folder = Path(os.environ.get("EDGEL_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"test data not found in {folder}; set EDGEL_DATA")
    return folder
