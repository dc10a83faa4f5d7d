"""Exact random access to a recurrent reconstruction."""
