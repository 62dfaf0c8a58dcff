"""Measuring detectors on labelled pictures, and training new ones (extras `cv` and `train`; `plot` for reports)."""
