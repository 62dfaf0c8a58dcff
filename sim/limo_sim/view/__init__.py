"""Watching a run: the live page, pictures, plots and recordings. Everything here looks on; nothing steers."""
