"""The parts of the page: each lays out its widgets once, and shows a `Page` whenever it changes."""
