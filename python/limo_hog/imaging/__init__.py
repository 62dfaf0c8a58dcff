"""Reading and writing images and videos, and drawing on them (extras `cv` and `video`)."""
