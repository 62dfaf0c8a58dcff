"""The live page: a server beside a run, whose newest moment it shows; the arena and `detect` fill it."""
