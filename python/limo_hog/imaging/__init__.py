"""Reading and writing images and videos, and drawing on them."""
