"""The viewer: a viser application over `etnet`."""
