"""Longer questions to the model, one module a subject: the studies, and which of them a view asks."""
