"""A view of a user's own, from a file or a function."""
