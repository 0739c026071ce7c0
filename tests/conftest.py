import os
from pathlib import Path

import pytest
from hypothesis import settings


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of the larger test data: EDGEL_DATA, or shared/data beside the repository."""
    folder = Path(os.environ.get("EDGEL_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"test data not found in {folder}; set EDGEL_DATA")
    return folder


# No deadline: the first example compiles kernels. CI draws the same examples every time, people draw new ones.
settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

# The source distribution holds the package and its tests, not what they would need here.
ROOT = Path(__file__).parent.parent
collect_ignore = [name for name in ("benchmarks", "training") if not (ROOT / name).is_dir()]
