"""Parsing of pages: well-formed, anchors, and what they refer to outside themselves."""

from html.parser import HTMLParser

VOID = ("meta", "img", "br", "input")


class Page(HTMLParser):
    """Open tags, references outside the page, links within it and their targets."""

    def __init__(self):
        super().__init__()
        self.open, self.links, self.anchors, self.targets, self.ids = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if "id" in values:
            assert values["id"] not in self.ids
            self.ids.append(values["id"])
        if tag == "section":
            self.targets.append(values["id"])
        for key in ("href", "src"):
            value = values.get(key, "data:")
            if value.startswith("#"):
                self.anchors.append(value[1:])
            elif not value.startswith("data:"):
                self.links.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def parsed(text):
    page = Page()
    page.feed(text)
    return page


def read_page(path):
    page = parsed(path.read_text())
    assert page.open == []
    return page
