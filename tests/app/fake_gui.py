"""A GUI that keeps what a panel lays out, for panels without a page."""

from types import SimpleNamespace


class FakeGui:
    """Widgets by their labels, each with what it was made of; HTML in the order in which it was added."""

    def __init__(self):
        self.widgets, self.html = {}, []

    def add_html(self, content):
        self.html.append(SimpleNamespace(content=content, visible=True))
        return self.html[-1]

    def add_checkbox(self, label, value, **more):
        return self._add(label, value, **more)

    def add_number(self, label, value, **more):
        return self._add(label, value, **more)

    def add_text(self, label, value, **more):
        return self._add(label, value, **more)

    def add_slider(self, label, low, high, step, value):
        return self._add(label, value, range=(low, high, step))

    def add_dropdown(self, label, options, **more):
        return self._add(label, options[0], options=options, **more)

    def add_button(self, label, **more):
        return self._add(label, False, **more)

    def _add(self, label, value, **more):
        handle = SimpleNamespace(**{"value": value, "visible": True, **more}, _impl=SimpleNamespace())
        handle.on_update = handle.on_click = lambda heard: heard
        self.widgets[label] = handle
        return handle
