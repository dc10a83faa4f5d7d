"""Judging reconstructions: measures, matching with ground truth, the protocols of the field, reports."""
