"""A page of HTML as a test reads it."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """What a page shows and what it would load; every tag has to be closed in order."""

    VOID = ("meta", "img", "br", "link", "source")

    def __init__(self, path):
        super().__init__()
        self.open, self.images, self.loaded, self.links, self.text, self.tags = [], [], [], [], [], []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "srcset"):
                self.images.append(value)
            elif tag == "a" and name == "href":
                self.links.append(value)
            elif name in ("href", "action", "xlink:href"):
                self.loaded.append(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text.append(data)

    @property
    def shown(self):
        return " ".join(" ".join(self.text).split())
