"""The viewer: a cloud and its edges in the browser, with what decides about them at hand.

The state (`edgel.view.session`) is plain Python; only `edgel.view.server` and the modules of the page need viser (extra
``view``).
"""
