"""Live: events while they come, from a camera, a stream or a recording that plays, as a recording that grows."""
