"""The viewer: a cloud and its edges in the browser, with what decides about them at hand.

The state (`edgel.view.session`) is plain Python; only `edgel.view.server` and the modules of the page need viser (extra
``view``). What the viewer does beyond `edgel.detect` is here for scripts too.
"""

from edgel.view.scale import detect_at_scale, median_spacing, thin
from edgel.view.select import drop_blunt, in_box

__all__ = ["detect_at_scale", "drop_blunt", "in_box", "median_spacing", "thin"]
