"""Measuring detectors on labelled pictures (extra `cv`; `plot` for reports)."""
