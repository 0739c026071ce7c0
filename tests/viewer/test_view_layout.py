"""Where clouds stand in the viewer's scene, and the first view of them."""

import numpy as np
from hall import TIMEOUT, roof

from edgel._viewer.layout import FIELD_OF_VIEW, lay_out


def test_clouds_stand_side_by_side(open_session, hall_file, tmp_path):
    small = tmp_path / "small.npy"
    np.save(small, roof() * 0.001 + [637012.0, 849028.0, 400.0])
    session = open_session([hall_file, str(small)])
    assert session.wait_idle(TIMEOUT)
    panes = session.panes()
    layout = lay_out([pane.source for pane in panes])
    assert not layout.same_scale
    boxes = []
    for pane, placement in zip(panes, layout.placements, strict=True):
        shown = placement.to_scene(pane.cloud.xyz)
        assert shown.dtype == np.float32
        assert np.abs(shown).max() < 5
        boxes.append(shown @ layout.right)
        direction = np.array([0.3, 0.4, 0.5])
        np.testing.assert_allclose(placement.rotation @ placement.to_cloud(direction), direction)
    assert boxes[0].max() < boxes[1].min()
    for aspect in (0.5, 2.0):
        view = layout.view(aspect)
        for pane, placement in zip(panes, layout.placements, strict=True):
            seen = placement.to_scene(pane.cloud.xyz) - view.position
            depth = seen @ layout.away
            assert (np.abs(seen @ layout.right) < np.tan(FIELD_OF_VIEW / 2) * aspect * depth).all()
            assert (np.abs(seen @ np.cross(layout.right, layout.away)) < np.tan(FIELD_OF_VIEW / 2) * depth).all()


def test_the_first_view_is_filled(open_session, tmp_path):
    depth = np.linspace(1.0, 3.0, 40)[:, None, None]
    across = np.linspace(-0.5, 0.5, 40)
    columns = np.broadcast_arrays(depth * across[:, None], depth * across, depth)
    pyramid = np.stack(columns, axis=-1).reshape(-1, 3)
    np.save(tmp_path / "pyramid.npy", pyramid)  # narrow where it is near: its box reaches far beside it there
    session = open_session([str(tmp_path / "pyramid.npy")])
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    layout = lay_out([pane.source])
    view = layout.view(1.0)
    seen = layout.placements[0].to_scene(pane.cloud.xyz) - view.position
    reach = np.abs(np.stack([seen @ layout.right, seen @ np.cross(layout.right, layout.away)])) / (seen @ layout.away)
    assert 0.9 < reach.max() / np.tan(FIELD_OF_VIEW / 2) < 1
