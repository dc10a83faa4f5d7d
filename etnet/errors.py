"""Errors a user can do something about. Each message says what, got, wanted, and what to do."""


class EtnetError(Exception):
    """Base of every error that this library raises on purpose."""


class RecordingError(EtnetError):
    """A recording cannot be opened or read as it stands."""


class WindowError(EtnetError):
    """A window policy does not fit its recording."""


class ModelError(EtnetError):
    """A model's configuration, name or input does not fit."""


class WeightsError(EtnetError):
    """Weights are missing, unreadable, or belong to another model."""


class Cancelled(EtnetError):
    """Work was given up because nobody wants its result any more."""
