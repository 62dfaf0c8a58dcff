"""The sensors: from the state of the world to readings, with noise and delay."""
