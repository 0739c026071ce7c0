"""The viewer: a cloud and its edges in the browser, with what decides about them at hand.

The state (`edgel._viewer.session`) is plain Python; only `edgel._viewer.server` and the modules of the page need viser
(extra ``view``).
"""
