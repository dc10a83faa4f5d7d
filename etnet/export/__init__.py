"""Frames on disk: images and video."""
