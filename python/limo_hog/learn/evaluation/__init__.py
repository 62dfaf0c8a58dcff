"""How good detectors are on labelled pictures: figures, curves, worst mistakes, and the page that shows them."""
